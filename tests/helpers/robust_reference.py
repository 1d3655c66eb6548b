"""The robust counterpart of (17) through CVXPY, from the formulation of one world."""

import cvxpy as cp

from fulcrum.synthesis.reference import _Formulation


def solve_robust_reference(problems):
    """The objective of the robust counterpart of (17): one grip for all worlds [N].

    Raises:
        ReferenceInfeasibleError: No normal forces of the hands serve all worlds.
        SolverError: The solver gave neither.
    """
    worlds = [_Formulation(problem) for problem in problems]
    first = worlds[0]
    constraints = [constraint for world in worlds for constraint in world.constraints()]
    for world in worlds[1:]:
        constraints += [
            a == b for a, b in zip(first.hand_normals(), world.hand_normals(), strict=True)
        ]
    return first.run(cp.Problem(cp.Minimize(first.objective()), constraints))
