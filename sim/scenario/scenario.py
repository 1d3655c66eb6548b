"""The scenario: frozen data about object, contacts, robots, path and execution."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from fulcrum.sim.geometry import GRAVITY, Geom, Object
from fulcrum.sim.scenario.contacts import Hand, Rest, Support
from fulcrum.sim.scenario.control import Control
from fulcrum.sim.scenario.path import Pivot, Poses
from fulcrum.sim.scenario.phases import HOLD, REACH, STANDOFF, TILT, Gap, Phase
from fulcrum.sim.scenario.physics import Physics, Tolerances
from fulcrum.sim.scenario.robot import Robot
from fulcrum.synthesis import InvalidInputError
from fulcrum.synthesis.arrays import Vector
from fulcrum.synthesis.markdown import number, numbers
from fulcrum.synthesis.render import Marked, Page, page, table, to_markdown
from fulcrum.synthesis.settings import Key, Settings, check


@dataclass(frozen=True)
class View(Settings):
    """Viewpoint of recordings, relative to the path's point."""

    eye: Annotated[Vector, Key("eye_m")] = (1.0, -0.5, 0.62)
    """Position of the eye [m]."""

    target: Annotated[Vector, Key("target_m")] = (0.05, 0.0, 0.12)
    """Point that the eye looks at [m]."""


@dataclass(frozen=True)
class Scenario:
    """All data of a scene that a run needs; scenes differ in nothing else."""

    name: str
    summary: str
    """One line for `fulcrum list`."""

    object: Object
    environment: tuple[Geom, ...]
    hands: tuple[Hand, ...]
    supports: tuple[Support, ...]
    robots: tuple[Robot, ...]
    path: Pivot | Poses
    rests: tuple[Rest, ...] = ()
    """Places where the object may lie besides its supports."""

    phases: tuple[Phase, ...] = (*REACH, *TILT, *HOLD)
    standoff: float = STANDOFF
    """Distance of the hands from their contacts at the start [m]."""

    holdable: bool = True
    """Whether forces that hold the object are expected to exist along the whole path."""

    control: Control = Control()
    physics: Physics = Physics()
    tolerances: Tolerances = Tolerances()
    view: View = View()

    def __post_init__(self) -> None:
        check("standoff", Gap, self.standoff)
        if not self.phases:
            raise InvalidInputError("phases", self.phases, "at least one phase")
        for name in self.contact_names:
            if self.contact_names.count(name) > 1:
                raise InvalidInputError("contact names", name, "a name that no other contact has")
        if not self.robots:
            raise InvalidInputError("robots", self.robots, "at least one robot")
        prefixes = [robot.prefix for robot in self.robots]
        for prefix in prefixes:
            if prefixes.count(prefix) > 1:
                valid = "a prefix that no other robot has"
                raise InvalidInputError("robot.prefix", repr(prefix), valid)
        geoms = [g.name for g in self.object.geoms]
        touched = [(hand.name, hand.geom) for hand in self.hands]
        touched += [(support.name, support.geom) for support in self.supports]
        touched += [("rest", rest.geom) for rest in self.rests]
        for name, geom in touched:
            if geom not in geoms:
                raise InvalidInputError(f"{name}.geom", geom, f"one of {', '.join(geoms)}")
        surfaces = [g.name for g in self.environment]
        for name in (*geoms, *surfaces):
            if [*geoms, *surfaces].count(name) > 1:
                raise InvalidInputError("geom names", name, "a name that no other geom has")
        placed = [(support.name, support.surface) for support in self.supports]
        placed += [("rest", rest.surface) for rest in self.rests]
        for name, surface in placed:
            if surface not in surfaces:
                raise InvalidInputError(f"{name}.surface", surface, f"one of {', '.join(surfaces)}")

    @property
    def contact_names(self) -> tuple[str, ...]:
        """Names of all contacts, hands first, in the order of every per-contact array."""
        return (*(hand.name for hand in self.hands), *(support.name for support in self.supports))

    @property
    def posture(self) -> dict[str, float]:
        """Start angle [rad or m] of every driven joint of all robots, by its name in the scene."""
        robots = self.robots
        return {r.prefix + joint: angle for r in robots for joint, angle in r.posture.items()}

    @property
    def still(self) -> tuple[str, ...]:
        """Joints that move only if the others cannot follow alone, by their names in the scene."""
        return tuple(robot.prefix + joint for robot in self.robots for joint in robot.still)

    @property
    def start_deviation(self) -> dict[str, float]:
        """Standard deviation of every driven joint's start [rad or m], by its name in the scene."""
        return {r.prefix + joint: r.start_deviation for r in self.robots for joint in r.posture}

    def page(self) -> Page:
        """Return object, robots, contacts, path and phases as a page."""
        thing, path, robots = self.object, self.path, self.robots
        contacts = [
            (
                hand.name,
                f"hand on {hand.mount}",
                number(hand.friction.mu),
                number(hand.friction.e_n) if hand.friction.e_n is not None else "",
                number(hand.f_n_max),
                numbers(hand.p_OC_O, 3),
            )
            for hand in self.hands
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
            for support in self.supports
        ]
        phases = [
            (
                phase.name,
                number(phase.duration_s),
                number(phase.tilt * path.angle_deg),
                number(1e3 * phase.gap),
                number(100.0 * phase.grip),
            )
            for phase in self.phases
        ]
        weight = f"{number(thing.mass)} kg ({number(thing.mass * GRAVITY)} N)"
        return page(
            (Marked(self.name), f": {self.summary}"),
            f"Object {thing.name}: {weight}, centre of mass at ({numbers(thing.center_of_mass, 3)})"
            f" m. Tilt by {number(path.angle_deg)} deg.",
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

    def _repr_markdown_(self) -> str:
        return to_markdown(self.page())


def lifted(scenario: Scenario) -> Scenario:
    """Return the scenario with its supports turned into rests, for an object that is lifted off."""
    rests = {Rest(s.geom, s.surface, s.friction, s.material) for s in scenario.supports}
    rests |= set(scenario.rests)
    ordered = tuple(sorted(rests, key=lambda rest: (rest.surface, rest.geom)))
    return replace(scenario, supports=(), rests=ordered, holdable=False)
