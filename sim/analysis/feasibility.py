"""Feasibility of a scenario before anything moves: reach, forces over the path, surroundings."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fulcrum.sim.analysis.explain import explain
from fulcrum.sim.analysis.explanation import Explanation
from fulcrum.sim.analysis.surroundings import Surroundings, surroundings
from fulcrum.sim.model import GripSchedule, RobotModel
from fulcrum.sim.motion import JointPath, PathError, plan_joints
from fulcrum.sim.planning import PathProblems, plan_grip
from fulcrum.sim.scenario import Control, Scenario, stretched, tilting
from fulcrum.sim.signals import torque_shares
from fulcrum.synthesis import (
    InfeasibleError,
    InvalidInputError,
    Objective,
    Problem,
    Solution,
    SolverError,
    Synthesizer,
    UnboundedError,
)
from fulcrum.synthesis.arrays import Array, N
from fulcrum.synthesis.render import Lines, Mark, Marked, Page, page, table
from fulcrum.synthesis.robust import RobustInfeasibleError

# Steps of the tilt [deg].
_STEP_DEG = 2.5
# Factors on the duration of the tilt that are tried if speed limits are exceeded [-].
_SLOWER = (1.5, 2.0, 4.0)


@dataclass(frozen=True, eq=False)
class Curves:
    """The forces, torques and friction needed over the tilt; NaN where there are no forces.

    Attributes:
        tilts_deg: Tilts [deg], (k,).
        grip: Normal forces of the hands [N], (k, n).
        torque: Largest share of a torque limit that is used [-], (k,); NaN without joints.
        joint: Joint with that share, by tilt; empty without joints.
        used: Largest share of the friction that these forces use [-], (k,).
        contact: Contact with that share, by tilt.
        least_used: Largest share for the forces that make it as small as possible [-], (k,).
    """

    tilts_deg: Array
    grip: Array
    torque: Array
    joint: tuple[str, ...]
    used: Array
    contact: tuple[str, ...]
    least_used: Array

    @property
    def holds(self) -> bool:
        """Whether forces exist at every tilt."""
        return bool(np.isfinite(self.used).all())


@dataclass(frozen=True, eq=False)
class Feasibility:
    """The answer whether a scenario is feasible, with the reasons.

    Attributes:
        unreachable: Why the arms cannot follow the path; None if they can.
        slower: Factor on the duration of the tilt with which the arms can follow [-]; None if no
            tried factor helps, or none is needed.
        clearances: Smallest distance of each joint to the ends of its range [rad or m].
        curves: Forces over the tilt; without joints if the arms cannot follow.
        grip: Least grip over the tilt; None if the controller asks for none.
        explanation: Why there are no forces, at the first tilt without forces; else None.
        surroundings: Result of comparing the object's path with the surfaces around it.
    """

    unreachable: PathError | None
    slower: float | None
    clearances: dict[str, float]
    curves: Curves
    grip: GripSchedule | None
    explanation: Explanation | None
    surroundings: Surroundings

    @property
    def feasible(self) -> bool:
        """Whether the arms can follow, forces exist, and the path fits the surroundings."""
        fits = not self.surroundings.misfits
        return fits and self.unreachable is None and self.curves.holds

    def page(self, scenario: Scenario, controller: str) -> Page:
        """Return the answers and their reasons as a page.

        Args:
            scenario: Scenario that was examined.
            controller: Name of the controller whose margins were used.
        """
        verdict = (
            Marked("FEASIBLE", Mark.GOOD) if self.feasible else Marked("NOT FEASIBLE", Mark.BAD)
        )
        head = ("question", "answer", "at")
        shown = page(
            (f"{scenario.name}, controller {controller}: ", verdict),
            table(head, [*self._fits(scenario), *self._reach(), *self._forces(scenario)]),
            Lines(tuple(misfit.text for misfit in self.surroundings.misfits)),
        )
        return shown if self.explanation is None else shown + self.explanation.page(controller)

    def _fits(self, scenario: Scenario) -> list[tuple[str, str, str]]:
        contacts = f"{len(scenario.hands)} hands, {len(scenario.supports)} supports"
        around = self.surroundings
        return [
            (question, "yes", where)
            if misfit is None
            else (question, "no: see below", f"{misfit.tilt_deg:.1f} deg")
            for question, misfit, where in (
                ("contacts on the surface", around.supports, contacts),
                ("object clear of obstacles", around.room, ""),
                ("object stable at both ends", around.stand, ""),
            )
        ]

    def _reach(self) -> list[tuple[str, str, str]]:
        if self.unreachable is not None:
            why = "; ".join(self.unreachable.reasons)
            where = f"{self.unreachable.tilt_deg:.1f} deg"
            return [("reach, speeds, collisions", f"no: {why}", where)]
        joint = min(self.clearances, key=lambda name: self.clearances[name])
        near = f"{self.clearances[joint]:.3g} rad or m"
        return [
            ("reach, speeds, collisions", "yes", ""),
            ("least distance to a joint limit", near, joint),
        ]

    def _forces(self, scenario: Scenario) -> list[tuple[str, str, str]]:
        curves, tilts = self.curves, self.curves.tilts_deg
        held = np.isfinite(curves.used)
        where = f"0 to {tilts[-1]:g} deg"
        if not held.all():
            more = np.count_nonzero(~held) - 1
            where = f"{tilts[~held][0]:.3g} deg, and {more} more of {len(tilts)}"
        rows = [("forces over the path", "yes" if held.all() else "no", where)]
        if held.any():
            step, hand = np.unravel_index(np.nanargmax(curves.grip), curves.grip.shape)
            where = f"{scenario.hands[hand].name}, {tilts[step]:.3g} deg"
            rows.append(("largest grip", f"{curves.grip[step, hand]:.1f} N", where))
            if np.isfinite(curves.torque).any():
                k = int(np.nanargmax(curves.torque))
                share = f"{100.0 * curves.torque[k]:.0f} % of its limit"
                rows.append(("largest torque", share, f"{curves.joint[k]}, {tilts[k]:.3g} deg"))
            k = int(np.nanargmax(curves.used))
            margin = f"{100.0 * (1.0 - curves.used[k]):.0f} %"
            rows.append(
                ("least friction margin", margin, f"{curves.contact[k]}, {tilts[k]:.3g} deg")
            )
        if self.grip is not None:
            k = int(np.argmin(self.grip.shares))
            share = f"{100.0 * self.grip.shares[k]:.0f} %"
            at = f"{math.degrees(self.grip.tilts[k]):g} deg"
            rows.append(("uncertainty borne by one grip", share, at))
        return rows


def feasibility(scenario: Scenario, control: Control) -> Feasibility:
    """Examine the whole path of a scenario.

    Args:
        scenario: Scene.
        control: Settings of the controller, which give margins and grip.
    """
    unreachable, slower, joint_path = None, None, None
    try:
        joint_path = plan_joints(scenario)
    except PathError as error:
        unreachable, slower = error, _slower(scenario, error)
    clearances = {}
    if joint_path is not None:
        names = RobotModel(scenario).joints
        clearances = dict(zip(names, joint_path.clearance.tolist(), strict=True))
    grip = None if joint_path is None else _grip(scenario, control, joint_path)
    problems = PathProblems(scenario, control, joint_path is not None, joint_path, grip)
    tilts, synthesizer = problems.tilts(_STEP_DEG), Synthesizer()
    found = [_solve(problems.problem(tilt), synthesizer) for tilt in tilts.tolist()]
    curves = _curves(scenario, control, tilts, found, synthesizer)
    missing = [tilt for tilt, (_, s) in zip(tilts.tolist(), found, strict=True) if s is None]
    why = explain(problems, missing[0], synthesizer) if missing else None
    around = surroundings(scenario)
    return Feasibility(unreachable, slower, clearances, curves, grip, why, around)


def _slower(scenario: Scenario, error: PathError) -> float | None:
    """Return the least tried factor on the tilt's duration that lets the arms follow, or None."""
    turns = tilting(scenario.phases)
    if not turns or not any("speed limit" in reason for reason in error.reasons):
        return None
    lasts = max(scenario.phases[i].duration_s for i in turns)
    for factor in _SLOWER:
        try:
            plan_joints(replace(scenario, phases=stretched(scenario.phases, factor * lasts)))
        except (PathError, InvalidInputError):
            continue
        return factor
    return None


def _grip(scenario: Scenario, control: Control, joint_path: JointPath) -> GripSchedule | None:
    """Return the controller's least grip; None if it asks for none or nothing can be held."""
    try:
        return plan_grip(scenario, control, joint_path)
    except (RobustInfeasibleError, SolverError):
        return None


def _solve(problem: Problem, synthesizer: Synthesizer) -> tuple[Problem, Solution | None]:
    """Return the problem, and its solution if there is one."""
    try:
        return problem, synthesizer.solve(problem)
    except InfeasibleError:
        return problem, None


def _least_used(problem: Problem, synthesizer: Synthesizer) -> float:
    """Return the least possible share of the friction in use [-]; NaN if there is no optimum."""
    try:
        margin = replace(problem, objective=Objective.FRICTION_MARGIN)
        return synthesizer.solve(margin).value
    except (InfeasibleError, SolverError, UnboundedError, InvalidInputError):
        return np.nan


def _curves(
    scenario: Scenario,
    control: Control,
    tilts: Array,
    found: list[tuple[Problem, Solution | None]],
    synthesizer: Synthesizer,
) -> Curves:
    contacts, hands = scenario.contact_names, len(scenario.hands)
    grip, used, least = np.full((len(tilts), hands), np.nan), [], []
    torque, joint, contact = [], [], []
    for k, (problem, solution) in enumerate(found):
        if solution is None:
            least.append(np.nan)
            used.append(np.nan)
            torque.append(np.nan)
            joint.append("")
            contact.append("")
            continue
        # Share of the full friction of the scenario, without the controller's margin.
        share = control.friction_factor * solution.utilisation
        grip[k] = solution.w_OC_C[:hands, N]
        used.append(float(share.max()))
        contact.append(contacts[int(share.argmax())])
        least.append(control.friction_factor * _least_used(problem, synthesizer))
        name, most = _torque(solution)
        torque.append(most)
        joint.append(name)
    return Curves(
        tilts,
        grip,
        np.array(torque),
        tuple(joint),
        np.array(used),
        tuple(contact),
        np.array(least),
    )


def _torque(solution: Solution) -> tuple[str, float]:
    """Return the joint that uses most of its torque limit, and that share [-]."""
    joints = solution.problem.joints
    if joints is None:
        return "", np.nan
    shares = torque_shares(solution.tau, joints.tau_min, joints.tau_max)
    worst = int(np.argmax(shares))
    return joints.names[worst], float(shares[worst])
