"""What is to be said about a scenario's problem at one tilt: why not, or how much it bears."""

from __future__ import annotations

from dataclasses import dataclass

from fulcrum.synthesis.analysis import ChangeOutcome, Conflict, Kind, Sensitivities
from fulcrum.synthesis.render import Mark, Marked, Page, page, table

# By which share of it a limit is relaxed to see whether that helps.
RELAXED = 0.1
# How many of the constraints that stop a change are named.
_NAMED = 4
# Relative slopes by the centre of mass below this are not shown [1/m]: 0.001 % per mm.
_VISIBLE_PER_M = 0.01


@dataclass(frozen=True)
class Remedy:
    """One kind of change: what is needed of it, or what can be borne.

    Attributes:
        outcome: See :class:`synthesis.analysis.relaxation.ChangeOutcome`.
        factor: The border of the feasible factors [-]; infinite for "any weight".
        confirmed_within: How near to the border solving again tells feasible from infeasible [-];
            infinite if not confirmed.
        text: In words.
        conflict: What stands in the way beyond the border.
    """

    outcome: ChangeOutcome
    factor: float
    confirmed_within: float
    text: str
    conflict: Conflict | None


@dataclass(frozen=True)
class Influence:
    """What a parameter does to the objective.

    Attributes:
        value: Of the parameter.
        unit: Of the parameter.
        slope: Derivative of the objective by it, in their units.
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
        value: The objective, in ``unit``.
        unit: N, N·m or -.
        normal_forces: Of each contact [N].
        active: Limits that are reached.
        sensitivities: Derivatives of the value.
        influences: The parameters that matter, by name.
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
        head = ("sensitivity", "value", f"slope [{self.unit} per unit]", "per 1 % [%]")
        return page(
            f"Objective {self.value:.5g}{unit}; normal forces: {forces}",
            f"At their limits: {', '.join(self.active) or 'none'}",
            table(head, rows),
        )


@dataclass(frozen=True)
class Explanation:
    """All that is to be said about a scenario's problem at one tilt.

    Attributes:
        scenario: Name of the scenario.
        object: Name of the object.
        objective: What is minimised.
        tilt_deg: [deg].
        weight: Of the object [N].
        feasible: Whether there are forces.
        conflict: Why not, of an infeasible problem.
        gains: By how much more weight can be held [-] if one limit of the conflict alone is relaxed
            by ``RELAXED``; of an infeasible problem that holds some weight.
        optimum: The solution of a feasible one.
        changes: By kind: what would help, or what is borne.
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
            controller: Name of the controller whose margins count.
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
        bound = "possible alone" if self.feasible else "needed alone"
        return shown + page(table(("change", bound, "limited by"), rows))


def _conflict_page(conflict: Conflict, gains: dict[str, float]) -> Page:
    """The sentence of a conflict, its balances, and its limits with what each can give."""
    sentence = conflict.sentence
    rows = [(name, f"{100 * share:.2f}", "", "") for name, share in conflict.balances.items()]
    for name, share in conflict.limits.items():
        given, gain = conflict.given.get(name), gains.get(name)
        rows.append(
            (
                name,
                f"{100 * share:.2f}",
                "" if given is None else f"{100 * given:.2f}",
                "" if gain is None else f"{100 * gain:+.2f}",
            )
        )
    relaxed = f"alone {100 * RELAXED:.0f} % better [% more weight]"
    head = ("conflict", "share [%]", "can give [% of asked]", relaxed)
    return page(f"{sentence[0].upper()}{sentence[1:]}.", table(head, rows))
