"""The error tree: every message names the culprit, what was given and what is valid."""

from __future__ import annotations


class FulcrumError(Exception):
    """Root of all errors that fulcrum raises on purpose."""


class InvalidInputError(FulcrumError, ValueError):
    """A field of a problem, scenario or configuration has a value that is not valid."""

    def __init__(self, field: str, given: object, valid: str) -> None:
        self.field, self.given, self.valid = field, given, valid
        if not isinstance(given, str):
            given = " ".join(str(given).split())
        elif not given.isprintable():
            given = repr(given)
        super().__init__(f"{field}: got {given}; valid is {valid}.")


class UnboundedError(FulcrumError):
    """There is no optimal solution: the objective improves as long as forces grow.

    Attributes:
        limit: Value that the objective approaches and never attains; None without such a value.
    """

    def __init__(self, objective: str, limit: float | None = None) -> None:
        self.limit = limit
        to = "" if limit is None else f" towards {limit:.3g} as forces grow"
        super().__init__(
            f"objective {objective} improves without limit{to}; "
            "give the hand contacts an f_n_max or the joints torque limits."
        )


class SolverError(FulcrumError):
    """The solver stopped with neither a solution nor a certificate."""

    def __init__(self, status: str) -> None:
        self.status = status
        super().__init__(f"the conic solver stopped with status {status}; valid is Solved.")
