"""Settings of Clarabel for all problems, and the settings to try where it stalls."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import clarabel
import scipy.sparse as sp

from fulcrum.synthesis.arrays import Array

# Statuses of a solution, to the first or to the second tolerance below.
SOLVED = ("Solved", "AlmostSolved")

# Feasibility and gap, relative to the load: 1e-6 of an objective that is a thousandth of the load,
# as near the balance point, at the cost of one iteration more than 1e-7 takes. On degenerate
# problems the linear algebra stalls a little above the first; the second is accepted, too.
TOLERANCE = 1e-9
_ACCEPTED_TOLERANCE = 1e-8
# Static regularisations [-] to try in turn where the solver stalls: almost none resolves problems
# on the brink of infeasibility, a large one those with an ill-conditioned optimum.
_REGULARISATIONS = (1e-12, 1e-6)


def solver_settings() -> clarabel.DefaultSettings:
    """Return quiet, single-threaded and tight settings that allow updates of the data."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = TOLERANCE
    settings.reduced_tol_feas = _ACCEPTED_TOLERANCE
    settings.reduced_tol_gap_abs = settings.reduced_tol_gap_rel = _ACCEPTED_TOLERANCE
    settings.tol_infeas_abs = settings.tol_infeas_rel = TOLERANCE
    # These three would remove rows or entries, and the data could not be updated.
    settings.presolve_enable = False
    settings.chordal_decomposition_enable = False
    settings.input_sparse_dropzeros = False
    return settings


def fallback_settings() -> Iterator[clarabel.DefaultSettings]:
    """Yield the settings to try in turn where :func:`solver_settings` stalls."""
    for regularisation in _REGULARISATIONS:
        settings = solver_settings()
        settings.equilibrate_enable = False
        settings.static_regularization_constant = regularisation
        yield settings


def attempts(
    q: Array, A: sp.csc_matrix, b: Array, cones: list[Any]
) -> Iterator[tuple[str, clarabel.DefaultSolution]]:
    """Yield status and result of a linear conic program, with one setting after the other."""
    P = sp.csc_matrix((len(q), len(q)))
    for settings in (solver_settings(), *fallback_settings()):
        result = clarabel.DefaultSolver(P, q, A, b, cones, settings).solve()
        yield str(result.status), result
