"""The one error tree: every message names the culprit, what was given and what is valid."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from synthesis.robust_certificate import RobustCertificate
    from synthesis.solution import Certificate


class FulcrumError(Exception):
    """Root of all errors that fulcrum raises on purpose."""


class InvalidInputError(FulcrumError, ValueError):
    """A field of a problem, scenario or configuration is non-finite, mis-shaped or senseless."""

    def __init__(self, field: str, given: object, valid: str) -> None:
        self.field, self.given, self.valid = field, given, valid
        super().__init__(f"{field}: got {_on_one_line(given)}; valid is {valid}.")


def _on_one_line(given: object) -> str:
    if isinstance(given, str):
        return given if given.isprintable() else repr(given)
    return " ".join(str(given).split())


class InfeasibleError(FulcrumError):
    """No contact forces satisfy all constraints of (17); carries the Farkas certificate."""

    def __init__(self, certificate: Certificate) -> None:
        self.certificate = certificate
        super().__init__(
            "no contact forces keep the object in equilibrium within all limits; "
            f"most binding: {', '.join(certificate.heaviest(3))}."
        )


class RobustInfeasibleError(FulcrumError):
    """No normal forces of the hands serve all worlds; carries the Farkas certificate."""

    def __init__(self, certificate: RobustCertificate) -> None:
        self.certificate = certificate
        super().__init__(
            f"no normal forces of the hands serve all {len(certificate.problems)} worlds; "
            f"most binding: {', '.join(certificate.heaviest(3))}."
        )


class UnboundedError(FulcrumError):
    """The objective improves without limit, so that no optimal solution exists."""

    def __init__(self, objective: str) -> None:
        super().__init__(
            f"objective {objective} improves without limit; "
            "give the hand contacts an f_n_max or the joints torque limits."
        )


class SolverError(FulcrumError):
    """The solver stopped without a solution and without a certificate."""

    def __init__(self, status: str) -> None:
        self.status = status
        super().__init__(f"the conic solver stopped with status {status}; valid is Solved.")


class InfeasiblePathError(FulcrumError):
    """No timing and forces satisfy all constraints along the path.

    Attributes:
        binding: The limits that weigh most in the proof, each with its place s on the path.
    """

    def __init__(self, binding: list[tuple[str, float]]) -> None:
        self.binding = binding
        named = [name if math.isnan(s) else f"{name} at s = {s:.4g}" for name, s in binding]
        super().__init__(
            "no timing and forces along the path keep all limits; "
            f"most binding: {', '.join(named)}."
        )
