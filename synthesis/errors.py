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
    """No optimal solution exists: the objective improves as long as forces grow.

    Attributes:
        limit: Value that the objective approaches without attaining it; None where it has none.
    """

    def __init__(self, objective: str, limit: float | None = None) -> None:
        self.limit = limit
        to = "" if limit is None else f" towards {limit:.3g} as forces grow"
        super().__init__(
            f"objective {objective} improves without limit{to}; "
            "give the hand contacts an f_n_max or the joints torque limits."
        )


class SolverError(FulcrumError):
    """The solver stopped without a solution and without a certificate."""

    def __init__(self, status: str) -> None:
        self.status = status
        super().__init__(f"the conic solver stopped with status {status}; valid is Solved.")
