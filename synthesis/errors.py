"""The one error tree: every message names the culprit, what was given and what is valid."""

from __future__ import annotations


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
