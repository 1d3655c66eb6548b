"""Analysis of a solution or of infeasibility: sensitivities, relaxations, conflicts."""

from fulcrum.synthesis.analysis.conflict import Conflict, and_list, relaxed, tightest
from fulcrum.synthesis.analysis.relaxation import (
    Change,
    ChangeOutcome,
    Kind,
    change,
    changes,
    weight_range,
)
from fulcrum.synthesis.analysis.sensitivity import UNITS, Sensitivities, sensitivities
