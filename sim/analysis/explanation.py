"""What limits a scenario at one tilt, by how much, and what to change: results and their page."""

from __future__ import annotations

from dataclasses import dataclass

from fulcrum.synthesis.analysis import ChangeOutcome, Conflict, Kind, Sensitivities
from fulcrum.synthesis.render import Mark, Marked, Page, page, table

# Share by which a limit is relaxed to test whether that helps [-].
RELAXED = 0.1
# Largest number of constraints shown that limit a change.
_NAMED = 4
# Smallest relative sensitivity to the centre of mass that is shown [1/m]: 0.001 % per mm.
_VISIBLE_PER_M = 0.01


@dataclass(frozen=True)
class Remedy:
    """One kind of change on its own, and how much of it is needed or possible.

    Attributes:
        outcome: See :class:`synthesis.analysis.relaxation.ChangeOutcome`.
        factor: Factor at which feasibility ends or begins [-]; infinite for "any weight".
        confirmed_within: Relative distance to that factor at which a second solve still tells
            feasible from infeasible [-]; infinite if not confirmed.
        text: The change in words.
        conflict: Constraints that limit the change at that factor.
    """

    outcome: ChangeOutcome
    factor: float
    confirmed_within: float
    text: str
    conflict: Conflict | None


@dataclass(frozen=True)
class Influence:
    """The effect of a parameter on the objective.

    Attributes:
        value: Value of the parameter.
        unit: Unit of the parameter.
        slope: Derivative of the objective by the parameter, in their units.
        per_percent: Change of the objective per percent of the parameter [%].
    """

    value: float
    unit: str
    slope: float
    per_percent: float


@dataclass(frozen=True)
class Optimum:
    """The optimal solution of a feasible problem.

    Attributes:
        value: Value of the objective, in ``unit``.
        unit: Unit of the objective: N, N·m or -.
        normal_forces: Normal force of each contact [N].
        active: Limits that are reached.
        sensitivities: Derivatives of the value.
        influences: Parameters that change the value, by name.
    """

    value: float
    unit: str
    normal_forces: dict[str, float]
    active: tuple[str, ...]
    sensitivities: Sensitivities
    influences: dict[str, Influence]

    def page(self) -> Page:
        """Return the optimum, the limits that it reaches, and its sensitivities as a page."""
        unit = "" if self.unit == "-" else f" {self.unit}"
        forces = ", ".join(f"{name} {f:.3f} N" for name, f in self.normal_forces.items())
        rows = []
        for name, influence in self.influences.items():
            own = "" if influence.unit == "-" else f" {influence.unit}"
            change = f"{influence.per_percent:+.3f}"
            rows.append((name, f"{influence.value:.4g}{own}", f"{influence.slope:+.4g}", change))
        for axis, slope in zip("xyz", self.sensitivities.center_of_mass, strict=True):
            if abs(slope) > _VISIBLE_PER_M * abs(self.value):
                share = 1e-3 * slope / self.value if self.value else 0.0
                change = f"{100 * share:+.2f} per mm"
                rows.append((f"centre of mass along {axis}", "per m", f"{slope:+.4g}", change))
        head = ("parameter", "value", f"slope [{self.unit} per unit]", "effect of +1 % [%]")
        return page(
            f"Optimal value {self.value:.5g}{unit}; normal forces: {forces}",
            f"Limits reached: {', '.join(self.active) or 'none'}",
            table(head, rows),
        )


@dataclass(frozen=True)
class Explanation:
    """An explanation of what limits a scenario's problem at one tilt, and by how much.

    Attributes:
        scenario: Name of the scenario.
        object: Name of the object.
        objective: Objective that is minimised.
        tilt_deg: Tilt [deg].
        weight: Weight of the object [N].
        feasible: Whether forces exist that hold the object.
        conflict: Why no forces exist; None for a feasible problem.
        gains: Relative gain of the weight that can be held [-] if only this limit of the conflict
            is relaxed by ``RELAXED``; empty if no weight can be held.
        optimum: Solution of a feasible problem; else None.
        changes: Needed or possible size of each kind of change on its own.
    """

    scenario: str
    object: str
    objective: str
    tilt_deg: float
    weight: float
    feasible: bool
    conflict: Conflict | None
    gains: dict[str, float]
    optimum: Optimum | None
    changes: dict[Kind, Remedy]

    def page(self, controller: str) -> Page:
        """Return verdict, conflict or optimum, and changes as a page.

        Args:
            controller: Name of the controller whose margins are used.
        """
        verdict = Marked("FEASIBLE", Mark.GOOD) if self.feasible else Marked("INFEASIBLE", Mark.BAD)
        shown = page(
            (
                f"{self.scenario} at {self.tilt_deg:g} deg, {self.weight:.4g} N, controller "
                f"{controller}, objective {self.objective}: ",
                verdict,
            )
        )
        if self.conflict is not None:
            shown += _conflict_page(self.conflict, self.gains)
        if self.optimum is not None:
            shown += self.optimum.page()
        rows = []
        for kind, remedy in self.changes.items():
            blocked = remedy.conflict
            names = [] if blocked is None else list(blocked.limits or blocked.balances)
            rows.append((kind, remedy.text, ", ".join(names[:_NAMED])))
        if self.feasible:
            what = "Forces still exist if one of these changes, the others staying as they are:"
            return shown + page(what, table(("quantity", "may change", "then limited by"), rows))
        what = "Forces exist after any one of these changes, the others staying as they are:"
        return shown + page(what, table(("quantity", "must change", "limited until then by"), rows))


def _conflict_page(conflict: Conflict, gains: dict[str, float]) -> Page:
    """Return a conflict as a page: its sentence, and share and gain of each of its limits."""
    sentence = conflict.sentence
    rows = []
    for name in conflict.limits:
        given, gain = conflict.given.get(name), gains.get(name)
        rows.append(
            (
                name,
                "" if given is None else f"{100 * given:.1f}",
                "" if gain is None else f"{100 * gain:z.1f}",
            )
        )
    gained = f"weight gained if it alone is relaxed by {100 * RELAXED:.0f} % [%]"
    head = ("limit", "provides at most [% of the load]", gained)
    return page(f"{sentence[0].upper()}{sentence[1:]}.", table(head, rows))
