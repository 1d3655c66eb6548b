"""Motions of object and hands made by hand: shared by the tests of the monitor."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from fulcrum.scenarios import scenario
from fulcrum.sim.evaluation.monitor import Monitor
from fulcrum.sim.model.object_path import ScrewPath
from fulcrum.sim.motion.schedule import Schedule
from fulcrum.sim.scenario.phases import Phase
from fulcrum.sim.signals.trace import Trace

GRIP_S, MOVE_S = 0.05, 0.2
PHASES = (
    Phase("grip", GRIP_S, tilt=0.0, gap=0.0, grip=1.0),
    Phase("tilt", MOVE_S, tilt=1.0, gap=0.0, grip=1.0),
    Phase("hold", 0.05, tilt=1.0, gap=0.0, grip=1.0),
)
BOX = replace(scenario("box-tilt"), standoff=0.0, phases=PHASES)
DT = BOX.physics.timestep
SETTLED = round(GRIP_S / DT)
STEPS = round(Schedule(BOX).total_s / DT)
LEFT, RIGHT, EDGE_LEFT, EDGE_RIGHT = range(4)
FIELDS = ("R_WC", "w_measured_C", "kept", "slip", "slide", "spin", "utilisation")
# Sums of 300 terms of 1e-3 and rotations of points at 1 m.
ROUNDING = 1e-13
TANGENT, ACROSS = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])


def quaternions(R):
    flat = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    return flat.reshape(*R.shape[:-2], 4)


def trace_of(tilt, rate):
    """Object and hands that move together along the scenario's path, tilt and rate (k,).

    All contacts stay at their points and push with 10 N into the object.
    """
    path = ScrewPath(BOX.path)
    trace = Trace.allocate(len(tilt), 14, 2, 4)
    trace.t[:] = DT * np.arange(len(tilt))
    trace.phase[:] = np.searchsorted(Schedule(BOX).ends - DT / 2.0, trace.t, side="right")
    poses = [path.pose(angle) for angle in tilt]
    R_WO, p_WO = np.array([R for R, _ in poses]), np.array([p for _, p in poses])
    trace.p_WO[:], trace.quat_WO[:] = p_WO, quaternions(R_WO)
    turn = rate[:, None] * path.direction
    trace.twist_WO[:, :3] = np.cross(turn, p_WO - np.array(BOX.path.point_W))
    trace.twist_WO[:, 3:] = turn
    touching = [*BOX.hands, *BOX.supports]
    points = np.array([getattr(c, "p_OC_O", None) or c.p_OP_O for c in touching])
    trace.p_WC[:] = p_WO[:, None] + np.einsum("kij,mj->kmi", R_WO, points)
    for i, hand in enumerate(BOX.hands):
        n, t = np.array(hand.normal_O), np.array(hand.tangent_O)
        R_WE = R_WO @ np.column_stack([t, np.cross(n, t), n])
        trace.p_WE[:, i] = trace.p_WC[:, i] - 0.03 * R_WE[..., 2]
        trace.quat_WE[:, i] = quaternions(R_WE)
        trace.twist_WE[:, i, :3] = np.cross(turn, trace.p_WE[:, i] - np.array(BOX.path.point_W))
        trace.twist_WE[:, i, 3:] = turn
        trace.f_W[:, i, :3] = 10.0 * R_WE[..., 2]
    trace.f_W[:, 2:, 2] = 10.0
    return trace


def resting():
    return trace_of(np.zeros(STEPS), np.zeros(STEPS))


def tilting():
    """A quarter turn at constant speed, from the settling time on."""
    rate = np.where(np.arange(STEPS) < SETTLED, 0.0, np.pi / 2.0 / (DT * (STEPS - SETTLED)))
    return trace_of(np.concatenate([[0.0], np.cumsum(rate)[:-1]]) * DT, rate)


def translate(trace, hand, velocity_O):
    """Moves a hand against the object with a velocity in the object's axes, (k, 3)."""
    way_O = np.concatenate([np.zeros((1, 3)), np.cumsum(velocity_O, axis=0)[:-1]]) * DT
    R_WO = Rotation.from_quat(trace.quat_WO, scalar_first=True)
    way_W = R_WO.apply(way_O)
    trace.p_WE[:, hand] += way_W
    trace.twist_WE[:, hand, :3] += R_WO.apply(velocity_O)
    trace.twist_WE[:, hand, :3] += np.cross(trace.twist_WO[:, 3:], way_W)


def from_settling(velocity):
    """A constant velocity that starts when the grip is settled, (k, 3)."""
    return np.where(np.arange(STEPS)[:, None] < SETTLED, 0.0, velocity)


def watched(trace):
    return Monitor(BOX).update(trace)
