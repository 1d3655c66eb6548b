"""Contact force synthesis: arrays in, contact forces and joint torques out; knows no simulator."""

from synthesis.contact import Contact, ContactModel, Role
from synthesis.errors import (
    FulcrumError,
    InfeasibleError,
    InvalidInputError,
    RobustInfeasibleError,
    SolverError,
    UnboundedError,
)
from synthesis.problem import Joints, Objective, Problem
from synthesis.solution import Certificate, Multipliers, Residuals, Solution
from synthesis.synthesizer import Synthesizer

__all__ = [
    "Certificate",
    "Contact",
    "ContactModel",
    "FulcrumError",
    "InfeasibleError",
    "InvalidInputError",
    "Joints",
    "Multipliers",
    "Objective",
    "Problem",
    "Residuals",
    "RobustInfeasibleError",
    "Role",
    "Solution",
    "SolverError",
    "Synthesizer",
    "UnboundedError",
]
