"""How object and arms are to move: schedule, inverse kinematics, references, path time."""
