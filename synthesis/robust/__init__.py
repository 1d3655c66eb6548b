"""Grips that serve every world of an uncertainty set, and proofs that no grip does."""

from fulcrum.synthesis.robust.certificate import RobustInfeasibleError
from fulcrum.synthesis.robust.grip import robust_grip
from fulcrum.synthesis.robust.scaling import Scaling, largest_scaling
from fulcrum.synthesis.robust.uncertainty_set import UncertaintySet
