"""How Clarabel is set for every problem here, and how where it stalls."""

from __future__ import annotations

from collections.abc import Iterator

import clarabel

# What it says of a solution, within the first or the second tolerance below.
SOLVED = ("Solved", "AlmostSolved")

# Feasibility and gap, relative to the load: 1e-6 of an objective that is a thousandth of the load,
# as near the balance point, at the cost of one iteration more than 1e-7 takes. On degenerate
# problems the linear algebra stalls a little above the first; the second is accepted, too.
TOLERANCE = 1e-9
_ACCEPTED_TOLERANCE = 1e-8
# Where the solver as set stalls, these static regularisations [-] are tried in turn: almost none
# resolves problems on the brink of infeasibility, much those with an ill-conditioned optimum.
_REGULARISATIONS = (1e-12, 1e-6)


def solver_settings() -> clarabel.DefaultSettings:
    """Quiet, single-threaded and tight; with the right to update the data."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.tol_feas = settings.tol_gap_abs = settings.tol_gap_rel = TOLERANCE
    settings.reduced_tol_feas = _ACCEPTED_TOLERANCE
    settings.reduced_tol_gap_abs = settings.reduced_tol_gap_rel = _ACCEPTED_TOLERANCE
    settings.tol_infeas_abs = settings.tol_infeas_rel = TOLERANCE
    # These three would remove rows or entries, and with them the right to update the data.
    settings.presolve_enable = False
    settings.chordal_decomposition_enable = False
    settings.input_sparse_dropzeros = False
    return settings


def fallback_settings() -> Iterator[clarabel.DefaultSettings]:
    """What to try, in this order, where the settings of :func:`solver_settings` stall."""
    for regularisation in _REGULARISATIONS:
        settings = solver_settings()
        settings.equilibrate_enable = False
        settings.static_regularization_constant = regularisation
        yield settings
