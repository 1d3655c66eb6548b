"""What a problem's solution or infeasibility means: sensitivities, relaxations, conflicts."""
