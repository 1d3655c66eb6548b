"""What is true beyond the belief, and what disturbs a run: drawn by seed, applied to signals."""
