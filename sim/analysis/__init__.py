"""Questions about a scenario without a run: why not, how heavy, what is in the way."""
