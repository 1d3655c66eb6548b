"""Contact force synthesis: arrays in, contact forces and joint torques out; knows no simulator."""

from fulcrum.synthesis.contact import Contact, ContactModel, Role
from fulcrum.synthesis.errors import FulcrumError, InvalidInputError, SolverError, UnboundedError
from fulcrum.synthesis.problem import Joints, Objective, Problem
from fulcrum.synthesis.solution import (
    Certificate,
    InfeasibleError,
    Multipliers,
    Residuals,
    Solution,
)
from fulcrum.synthesis.synthesizer import Synthesizer
