"""From a scenario file to a Scenario, with errors by file, line and key."""
