"""The page with the result of a search for a placement."""

from __future__ import annotations

import math

from fulcrum.sim.placement.search import Placement
from fulcrum.sim.placement.value import Value
from fulcrum.sim.scenario import Scenario
from fulcrum.synthesis.render import Lines, Mark, Marked, Page, page, table

# Smallest change of an angle that is listed [deg].
_LISTED_DEG = 1.0


def placement_page(scenario: Scenario, found: Placement) -> Page:
    """Return gains, refused candidates, changes, and the run that tested them as a page.

    Args:
        scenario: Scene before the search.
        found: Result of the search.
    """
    better = found.improved
    verdict = Marked("BETTER", Mark.GOOD) if better else Marked("NOTHING BETTER", Mark.BAD)
    done, end = found.history[-1][0], "" if found.in_time else " (time limit)"
    refused = [
        f"a better candidate was rejected: {reason}" for reason in dict.fromkeys(found.refused)
    ]
    shown = page(
        (
            f"{scenario.name}, goal {found.goal}: ",
            verdict,
            f" after {done} placements in {found.seconds:.0f} s{end}",
        ),
        table(("over the path", "before", "after"), _rows(found.before, found.after)),
        "" if found.before.feasible else f"Before: {found.before.reason}",
        Lines(tuple(refused)),
    )
    report = found.report
    if report is None:
        return shown
    slip = max(contact.slip_mm for contact in report.contacts.values())
    return shown + page(
        table(("change", "from", "to"), _moves(scenario, found.scenario)),
        (
            "In closed loop: ",
            report.verdict.shown,
            f", tilt error at most {report.tilt.max_error_deg:.3f} deg, slip at most {slip:.3f} mm,"
            f" torque at most {100 * report.torque.max_utilisation:.0f} % of its limit "
            f"({report.torque.joint})",
        ),
    )


def _rows(before: Value, after: Value) -> list[tuple[str, ...]]:
    def share(value: float) -> str:
        return f"{100.0 * value:.1f} %" if math.isfinite(value) else "-"

    return [
        ("forces exist", *("yes" if value.feasible else "no" for value in (before, after))),
        ("heaviest object", *(f"{value.heaviest:.2f} N" for value in (before, after))),
        ("largest share of friction used", *(share(value.friction) for value in (before, after))),
        (
            "largest share of torque limits used",
            *(share(value.torque) for value in (before, after)),
        ),
        (
            "least distance to a joint limit",
            *(f"{value.clearance:.3g} rad or m" for value in (before, after)),
        ),
    ]


def _moves(before: Scenario, after: Scenario) -> list[tuple[str, ...]]:
    def millimetres(values: tuple[float, ...]) -> str:
        return ", ".join(f"{1e3 * value:.1f}" for value in values) + " mm"

    def direction(values: tuple[float, ...]) -> str:
        return ", ".join(f"{value:.3f}" for value in values)

    rows: list[tuple[str, ...]] = []
    for old, new in zip(before.robots, after.robots, strict=True):
        name = f"{new.prefix}base"
        rows.append((name, millimetres(old.base.position), millimetres(new.base.position)))
        turns = direction(old.base.quaternion), direction(new.base.quaternion)
        rows.append((f"{name}, quaternion", *turns))
    for held, moved in zip(before.hands, after.hands, strict=True):
        rows.append((held.name, millimetres(held.p_OC_O), millimetres(moved.p_OC_O)))
        rows.append(
            (f"{held.name}, tangent", direction(held.tangent_O), direction(moved.tangent_O))
        )
    posture = after.posture
    for joint, angle in before.posture.items():
        if abs(math.degrees(posture[joint] - angle)) > _LISTED_DEG:
            ends = (f"{math.degrees(q):.1f} deg" for q in (angle, posture[joint]))
            rows.append((joint, *ends))
    return [row for row in rows if row[1] != row[2]]
