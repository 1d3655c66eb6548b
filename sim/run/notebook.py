"""What notebooks show of scenarios, runs, plans and sweeps; a run's recording shows it too."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from fulcrum.sim.geometry.object import GRAVITY
from fulcrum.synthesis.markdown import escaped, number, numbers, page, table

if TYPE_CHECKING:
    from fulcrum.sim.evaluation.report import Report
    from fulcrum.sim.planning.plan import Plan
    from fulcrum.sim.run.execute import Result
    from fulcrum.sim.scenario.scenario import Scenario
    from fulcrum.sim.sweep.farm import Outcome

# How many limits of a plan, and causes of a sweep's failures, are named.
_NAMED = 6


def scenario_markdown(scenario: Scenario) -> str:
    """Object, robots, contacts, path and phases of a scenario."""
    thing, path, robots = scenario.object, scenario.path, scenario.robots
    contacts = [
        (
            hand.name,
            f"hand on {hand.mount}",
            number(hand.friction.mu),
            number(hand.friction.e_n) if hand.friction.e_n is not None else "",
            number(hand.f_n_max),
            numbers(hand.p_OC_O, 3),
        )
        for hand in scenario.hands
    ]
    contacts += [
        (
            support.name,
            f"support on {support.surface}",
            number(support.friction.mu),
            "",
            "∞",
            numbers(support.p_OP_O, 3),
        )
        for support in scenario.supports
    ]
    phases = [
        (
            phase.name,
            number(phase.duration_s),
            number(phase.tilt * path.angle_deg),
            number(1e3 * phase.gap),
            number(100.0 * phase.grip),
        )
        for phase in scenario.phases
    ]
    return page(
        f"**{escaped(scenario.name)}**: {escaped(scenario.summary)}",
        f"Object {escaped(thing.name)}: {number(thing.mass)} kg ({number(thing.mass * GRAVITY)} N)"
        f", centre of mass at ({numbers(thing.center_of_mass, 3)}) m. Tilt by "
        f"{number(path.angle_deg)} deg.",
        table(
            ("robot", "prefix of its names", "stands at [m]", "driven joints"),
            [(r.model, r.prefix, numbers(r.base.position, 3), len(r.posture)) for r in robots],
        ),
        table(
            ("contact", "what", "μ", "e_n [m]", "f_n at most [N]", "place on the object [m]"),
            contacts,
        ),
        table(("phase", "takes [s]", "tilt [deg]", "gap [mm]", "grip [%]"), phases),
    )


def report_markdown(report: Report) -> str:
    """Verdict, failures, events and contacts of a run."""
    tilt, torque = report.tilt, report.torque
    contacts = [
        (
            name,
            f"{c.kept_percent:.1f}",
            f"{c.slip_mm:.3f}",
            f"{c.slide_mm:.3f}",
            f"{c.spin_deg:.3f}",
            f"{100.0 * c.max_utilisation:.0f}",
            f"{c.force_error_rms_n:.2f}",
        )
        for name, c in report.contacts.items()
    ]
    head = ("contact", "kept [%]", "slip [mm]", "slide [mm]", "spin [deg]", "friction used [%]")
    return page(
        f"# {escaped(report.scenario)}: {report.verdict.upper()}",
        [f"- {escaped(failure)}" for failure in report.failures],
        table(
            ("time [s]", "found", "done"),
            [(f"{e.t:.3f}", e.cause, e.reaction) for e in report.events],
        ),
        f"Controller {escaped(report.controller)}, objective {escaped(report.objective)}, seed "
        f"{report.seed}.\n"
        f"Tilt {tilt.final_deg:z.2f} of {tilt.target_deg:g} deg, error at most "
        f"{tilt.max_error_deg:.3f} deg; torque at most {100 * torque.max_utilisation:.0f} % of "
        f"its limit ({escaped(torque.joint)}).",
        table((*head, "force error [N]"), contacts),
    )


def result_markdown(result: Result) -> str:
    """The report of a run, and what ended it, if something did."""
    ended = "" if result.error is None else f"Ended by: {escaped(result.error)}"
    return page(report_markdown(result.report), ended)


def plan_markdown(plan: Plan) -> str:
    """Duration of a plan, the stretches of its tilt, and the limits that it uses most."""
    from fulcrum.sim.planning.file import stretches

    found = plan.solution
    places = np.degrees(plan.tilt[found.problem.stations[:, 0]])
    used = sorted(found.shares.items(), key=lambda item: -item[1].max())[:_NAMED]
    return page(
        f"**{escaped(plan.scenario.name)}, {escaped(found.problem.objective)}**: "
        f"{plan.duration:.4f} s for {number(plan.scenario.path.angle_deg)} deg, at most "
        f"{math.degrees(plan.peak_rate):.1f} deg/s",
        table(
            ("tilt [deg]", "limits used up"),
            [
                (f"{low:.1f} to {high:.1f}", ", ".join(limits) or "none")
                for low, high, limits in stretches(plan)
            ],
        ),
        table(
            ("limit", "used at most [%]", "at [deg]"),
            [
                (name, f"{100.0 * share.max():.1f}", f"{places[int(share.argmax())]:.1f}")
                for name, share in used
            ],
        ),
    )


def outcome_markdown(outcome: Outcome) -> str:
    """Success rate of each controller of a sweep, and what its failures began with."""
    rows = [
        (
            score.controller,
            f"{score.successes} of {score.episodes}",
            f"{100.0 * score.rate:.1f} ({100.0 * score.low:.1f} to {100.0 * score.high:.1f})",
            f"{score.grip_n:.1f}",
            ", ".join(f"{c.cause} ({c.episodes})" for c in score.causes[:_NAMED]) or "none",
        )
        for score in outcome.scores
    ]
    head = ("controller", "episodes", "success (95 %) [%]", "grip [N]", "failures began with")
    return page("**Sweep**", table(head, rows))
