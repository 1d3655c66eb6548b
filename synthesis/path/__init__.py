"""Timing, forces and torques along a whole path, as one second-order cone program."""

from fulcrum.synthesis.path.limits import Accelerations, Rates
from fulcrum.synthesis.path.loads import solve_many
from fulcrum.synthesis.path.problem import InertialTorques, Load, PathObjective, PathProblem
from fulcrum.synthesis.path.solution import InfeasiblePathError, PathSolution
