"""The paper's figures 5 to 8 and every number it states, computed, measured and compared."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fulcrum.scenarios.paper.cases import (
    FORCE_OBJECTIVES,
    PAPER_TILT_DEG,
    TORQUE_OBJECTIVES,
    TiltCurve,
    paper_cylinder,
    tilt_curve,
)
from fulcrum.scenarios.paper.figures import Curve, Figure, draw
from fulcrum.scenarios.paper.statements import Statement, all_statements
from fulcrum.scenarios.reading.library import scenario
from fulcrum.sim.evaluation import Verdict
from fulcrum.sim.planning import PathProblems
from fulcrum.sim.run import Request, write_json
from fulcrum.sim.run.execute import execute
from fulcrum.sim.scenario import Scenario, controllers
from fulcrum.synthesis import Objective
from fulcrum.synthesis.arrays import N
from fulcrum.synthesis.render import Line, Lines, Mark, Marked, Page, page

Step = Callable[[str], None]
STEPS = 7
_FORCE = "normal force [N]"
# The second objective of a kind often lies on the first: it is drawn dotted over it.
_STYLES = {"GFOP max": "-", "GFOP norm": ":", "TOP max": "-", "TOP norm": ":"}


@dataclass(frozen=True)
class Reproduction:
    """The paper's results beside ours.

    Attributes:
        statements: The paper's numbers beside ours.
        grip_errors: RMS of the measured minus the computed normal force over the peak of the
            computed one [-], of both hands, by closed loop.
    """

    statements: tuple[Statement, ...]
    grip_errors: dict[str, list[float]]

    def page(self) -> Page:
        """Return every statement with both numbers and the reason, and the grip errors."""
        lines: list[Line] = []
        for s in self.statements:
            numbers = (f": {s.statement}: ", Marked(s.paper), "; ours: ", Marked(s.ours))
            lines += [(_MARKS[s.reproduced], *numbers), f"    {s.reason}"]
        for name, errors in self.grip_errors.items():
            percent = " and ".join(f"{100 * error:.2f} %" for error in errors)
            lines.append(f"closed loop, {name}: RMS error of the grip {percent} of its peak")
        return page(Lines(tuple(lines)))


_MARKS = {
    True: Marked("reproduced", Mark.GOOD),
    False: Marked("not reproduced", Mark.BAD),
    None: Marked("side by side"),
}


def reproduce(out: Path, step: Step) -> Reproduction:
    """Compute, run, draw and compare; write figures (PNG, CSV) and ``paper.json``.

    Args:
        out: Folder of the results.
        step: Called with a description at the start of every step.
    """
    box, cylinder = scenario("box-tilt"), paper_cylinder()
    exact_box, exact_cylinder = (controllers(s.control)["paper"] for s in (box, cylinder))
    step("box: GFOP and TOP over the tilt")
    box_tilts = np.arange(0.0, 90.5, 1.0)
    box_curves = {
        name: tilt_curve(PathProblems(box, replace(exact_box, objective=objective)), box_tilts)
        for name, objective in (FORCE_OBJECTIVES | TORQUE_OBJECTIVES).items()
    }
    step("cylinder: GFOP over the tilt")
    cylinder_tilts = np.arange(0.0, PAPER_TILT_DEG + 0.5, 1.0)
    cylinder_curves = {
        name: tilt_curve(
            PathProblems(cylinder, replace(exact_cylinder, objective=objective), False),
            cylinder_tilts,
        )
        for name, objective in FORCE_OBJECTIVES.items()
    }
    step("closed loop: box, least grip")
    loops = {"GFOP": closed_loop(box, box.control.objective)}
    step("closed loop: box, least torque")
    loops["TOP"] = closed_loop(box, Objective.MAX_TORQUE)
    step("closed loop: cylinder")
    loops["cylinder"] = closed_loop(scenario("cylinder-tilt"), Objective.MAX_NORMAL_FORCE)
    step("figures")
    for figure in (
        *_cylinder_figures(cylinder_curves, loops["cylinder"]),
        *_box_figures(box_curves, loops["GFOP"], loops["TOP"]),
    ):
        draw(figure, out)
    step("numbers")
    statements = all_statements(box_curves, cylinder_curves)
    errors = {
        name: [grip_error(loop, contact) for contact in range(2)] for name, loop in loops.items()
    }
    table = [dataclasses.asdict(statement) for statement in statements]
    write_json(out / "paper.json", {"statements": table, "closed_loop_grip_error": errors})
    return Reproduction(tuple(statements), errors)


@dataclass(frozen=True, eq=False)
class Loop:
    """Forces and torques over the tilt, measured in closed loop and computed for its problem."""

    measured: TiltCurve
    computed: TiltCurve

    @property
    def drawn(self) -> tuple[tuple[str, TiltCurve, str], ...]:
        """What figures show of it: in words, the curve, and its style."""
        return ("with margin", self.computed, "--"), ("closed loop", self.measured, ".")


def closed_loop(chosen: Scenario, objective: Objective) -> Loop:
    """Run a scenario with its own control, and compute its problem over the tilt."""
    control = replace(chosen.control, objective=objective)
    result = execute(Request(chosen, "margin", control))
    if result.report.verdict is Verdict.INTERRUPTED:
        raise KeyboardInterrupt
    trace, history = result.trace, result.history
    tilting = [i for i, p in enumerate(chosen.phases) if p.name == "tilt"]
    rows = np.flatnonzero(np.isin(trace.phase, tilting))[::20]
    measured = TiltCurve(
        tilt_deg=np.degrees(trace.tilt[rows]),
        normal=history.w_measured_C[rows][..., N],
        torque=np.abs(trace.tau[rows]).max(axis=1),
        solve_s=trace.synthesis_s[rows],
    )
    end = chosen.path.angle_deg
    computed = tilt_curve(PathProblems(chosen, control), np.linspace(0.0, end, round(end) + 1))
    return Loop(measured, computed)


def grip_error(loop: Loop, contact: int) -> float:
    """Return the RMS of measured minus computed normal force over the computed peak [-]."""
    expected = np.interp(
        loop.measured.tilt_deg, loop.computed.tilt_deg, loop.computed.normal[:, contact]
    )
    error = loop.measured.normal[:, contact] - expected
    return float(np.sqrt(np.mean(error**2)) / loop.computed.normal[:, contact].max())


def _curves(
    found: dict[str, TiltCurve], loops: dict[str, Loop], contacts: dict[str, int]
) -> list[Curve]:
    """Return normal forces of contacts over the tilt: as the paper has them, and as measured."""
    curves = [
        Curve(f"{name}, {contact}", s.tilt_deg, s.normal[:, index], _STYLES[name])
        for name, s in found.items()
        for contact, index in contacts.items()
    ]
    return curves + [
        Curve(f"{name} {kind}, {contact}", s.tilt_deg, s.normal[:, index], style)
        for name, loop in loops.items()
        for contact, index in contacts.items()
        for kind, s, style in loop.drawn
    ]


def _margins(chosen: Scenario) -> str:
    control = chosen.control
    return f"{100 * control.friction_factor:g} % of the friction, preload {control.preload:g} N"


def _cylinder_figures(found: dict[str, TiltCurve], loop: Loop) -> list[Figure]:
    tilted = scenario("cylinder-tilt")
    depth = -tilted.supports[0].p_OP_O[0] - tilted.hands[0].p_OC_O[0]
    caption = (
        "Cylinder of Table I: 30 N, 0.36/0.30 x 0.5 m, mu_E 0.2, mu_C 0.15, e_n 0.25 m, grip at "
        "most 30 N, fingers at the rim of the upper wall. With margin and in closed loop: fingers "
        f"{depth:.2g} m inside, {_margins(tilted)}."
    )
    drawn = {
        "a": ("Finger forces", {"f_n1 (outer)": 0, "f_n2 (inner)": 1}),
        "b": ("Environment force", {"f_En": 2}),
    }
    return [
        Figure(f"figure-5{letter}", title, _FORCE, caption, _curves(found, {"GFOP": loop}, which))
        for letter, (title, which) in drawn.items()
    ]


def _box_figures(found: dict[str, TiltCurve], gfop: Loop, top: Loop) -> list[Figure]:
    caption = (
        "Box of Table II: 20 N, 0.3 x 0.2 x 0.1 m, mu_E 0.25, mu_C 0.1, e_n 0.5 m, hands 0.225 m "
        "along and 0.05 m up from the edge, Baxter's limits. With margin and in closed loop: "
        f"{_margins(scenario('box-tilt'))}."
    )
    loops = {"GFOP": gfop, "TOP": top}
    kinds = {"GFOP": FORCE_OBJECTIVES, "TOP": TORQUE_OBJECTIVES}
    figures = []
    for number, what, contacts in (
        ("6", "Hand forces", {"left": 0, "right": 1}),
        ("7", "Environment forces", {"edge left": 2, "edge right": 3}),
    ):
        for letter, (kind, loop) in zip("ab", loops.items(), strict=True):
            curves = _curves({name: found[name] for name in kinds[kind]}, {kind: loop}, contacts)
            name, title = f"figure-{number}{letter}", f"{what}, {kind}"
            figures.append(Figure(name, title, _FORCE, caption, curves))
    torque = [Curve(name, s.tilt_deg, s.torque, _STYLES[name]) for name, s in found.items()]
    torque += [
        Curve(f"{kind} {how}", s.tilt_deg, s.torque, style)
        for kind, loop in loops.items()
        for how, s, style in loop.drawn
    ]
    return [*figures, Figure("figure-8", "Largest joint torque", "|torque| [N m]", caption, torque)]
