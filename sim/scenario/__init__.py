"""What a scenario says: object, contacts, robots, path, phases, control, physics, tolerances."""
