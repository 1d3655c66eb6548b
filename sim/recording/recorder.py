"""The recorder, which writes a run to a Rerun recording while it runs."""

from __future__ import annotations

import colorsys
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
from rerun.components import AggregationPolicy

from fulcrum.sim.evaluation import ContactHistory
from fulcrum.sim.model import true_contacts
from fulcrum.sim.model.object_path import object_path
from fulcrum.sim.planning import Plan
from fulcrum.sim.recording.blueprint import TIMELINE, blueprint
from fulcrum.sim.recording.columns import arrows, scalars, strips
from fulcrum.sim.recording.scenery import Scenery
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import Mode, Trace, torque_shares
from fulcrum.synthesis.arrays import Array, N


class _Look(NamedTuple):
    color: tuple[int, ...]
    radius: float  # [m]


_POSE_PERIOD = 0.02  # [s] between poses in the 3D view
_METERS_PER_NEWTON = 0.003
_CONE_LENGTH = 0.06  # [m]
_CONE_RAYS = 6
_CONE = _Look((250, 190, 40), 0.0003)
# The commanded arrow is thin and inside the measured one; it is seen where they differ.
_LOOKS = {
    "measured": _Look((220, 30, 30), 0.006),
    "commanded": _Look((40, 110, 250), 0.002),
}


class Recorder:
    """A recorder that streams blocks of a run into a file, and to a viewer if one is given.

    Force arrows show the forces on the object. They start at their contact and must lie in the
    friction cone, which starts there, too. They point into the object, which is translucent.
    """

    def __init__(
        self,
        path: Path,
        scenario: Scenario,
        config: dict[str, Any],
        joints: tuple[str, ...],
        tau_min: Array,
        tau_max: Array,
        plan: Plan | None = None,
        viewer_url: str | None = None,
    ) -> None:
        """Open the file and write everything that does not change.

        Args:
            path: File to write.
            scenario: Scenario of the run.
            config: Resolved configuration, shown as text.
            joints: Names of the l driven joints.
            tau_min: Lower torque limits [N·m or N], (l,).
            tau_max: Upper torque limits [N·m or N], (l,).
            plan: Plan of the tilt, shown beside the measurements; None if it is not planned.
            viewer_url: URL of a viewer that follows the run; None if there is none.
        """
        self._scenario = scenario
        self._cones = np.array([_cone(contact.mu) for contact in true_contacts(scenario)])
        self._tau_min, self._tau_max = tau_min, tau_max
        self._plan, self._path = plan, object_path(scenario.path)
        self._stride = max(1, round(_POSE_PERIOD / scenario.physics.timestep))
        # A viewer keeps the first blueprint of an application id; so each scenario has its own id.
        self._recording = rr.RecordingStream(f"fulcrum {scenario.name}")
        sinks: list[Any] = [rr.FileSink(path)]
        self._streamed = viewer_url is not None
        if viewer_url is not None:
            sinks.append(rr.GrpcSink(viewer_url))
        layout = blueprint(scenario, np.asarray(scenario.path.point_W))
        self._recording.set_sinks(*sinks, default_blueprint=layout)
        self._state = np.array([-1.0, -1.0])  # phase and mode of the last row
        self._scenery = Scenery(scenario, joints)
        self._scenery.log_shapes(self._recording)
        self._log_static(config, joints)
        self._flush()  # logged items are buffered, columns are not

    def _log_static(self, config: dict[str, Any], joints: tuple[str, ...]) -> None:
        text = f"```json\n{json.dumps(config, indent=2)}\n```"
        self._log_text("config", text)
        self._log_text("verdict", "The run has not ended.")
        names = self._scenario.contact_names
        forces = [f"{n} {kind}" for kind in ("commanded", "measured") for n in names]
        bright = colors(len(names))
        pale = [_pale(color) for color in bright]
        limit = [(120, 120, 120)] * 2
        joint_colors = colors(len(joints))
        if self._plan is not None:
            paler = [_pale(color) for color in pale]
            for path, series, palette in (
                ("normal_force", list(names), paler),
                ("torque", list(joints), [_pale(color) for color in joint_colors]),
            ):
                lines = rr.SeriesLines(names=[f"{n} planned" for n in series], colors=palette)
                self._recording.log(f"plots/{path}/planned", lines, static=True)
        for path, series, palette in (
            ("tilt", ["reference", "measured"], [_pale(bright[0]), bright[0]]),
            ("tilt_rate", ["reference", "measured"], [_pale(bright[0]), bright[0]]),
            ("tilt_error", ["measured - reference"], bright[:1]),
            ("normal_force", forces, [*pale, *bright]),
            ("utilisation", list(names), bright),
            ("slip", list(names), bright),
            ("torque", [*joints, "lower limit", "upper limit"], [*joint_colors, *limit]),
            ("synthesis", ["synthesis"], bright[:1]),
        ):
            lines = rr.SeriesLines(
                names=series, colors=palette, aggregation_policy=AggregationPolicy.MinMax
            )
            self._recording.log(f"plots/{path}", lines, static=True)
        labels = {"labels": names, "show_labels": False}
        for kind, look in _LOOKS.items():
            arrow = rr.Arrows3D.from_fields(colors=[look.color], radii=[look.radius], **labels)
            self._recording.log(f"forces/{kind}", arrow, static=True)
        cone = rr.LineStrips3D.from_fields(colors=[_CONE.color], radii=[_CONE.radius], **labels)
        self._recording.log("cones", cone, static=True)

    def _log_text(self, path: str, text: str) -> None:
        document = rr.TextDocument(text, media_type=rr.MediaType.MARKDOWN)
        self._recording.log(path, document, static=True)

    def write(self, block: Trace, history: ContactHistory) -> None:
        """Append the next rows of the run."""
        time = rr.TimeColumn(TIMELINE, duration=block.t)
        tilt = np.degrees(np.column_stack([block.tilt_ref, block.tilt]))
        self._send("tilt", time, tilt)
        self._send("tilt_error", time, tilt[:, 1:] - tilt[:, :1])
        axis = self._path.axis(block.tilt)
        turning = np.einsum("ki,ki->k", block.twist_WO[:, 3:], axis)
        rate = np.column_stack([block.rate_ref, turning])
        self._send("tilt_rate", time, np.degrees(rate))
        normal = np.column_stack([block.w_commanded_C[..., N], history.w_measured_C[..., N]])
        self._send("normal_force", time, normal)
        self._send("utilisation", time, np.where(history.kept, history.utilisation, 0.0))
        self._send("slip", time, 1e3 * history.slip)
        limits = np.broadcast_to([-1.0, 1.0], (len(block), 2))
        self._send("torque", time, np.column_stack([self._shares(block.tau), limits]))
        due = block.synthesis_s > 0.0
        if due.any():
            solves = rr.TimeColumn(TIMELINE, duration=block.t[due])
            self._send("synthesis", solves, 1e6 * block.synthesis_s[due, None])
        self._send_plan(block)
        self._send_phases(block)
        self._send_scene(block, history)

    def _send(self, path: str, time: rr.TimeColumn, values: Array) -> None:
        self._recording.send_columns(f"plots/{path}", [time], scalars(values))

    def _shares(self, tau: Array) -> Array:
        """Return torques as signed shares of their limits [-]."""
        return torque_shares(tau, self._tau_min, self._tau_max) * np.sign(tau)

    def _send_plan(self, block: Trace) -> None:
        """Send the planned values at the tilts of the rows in which the path moves."""
        moving = block.rate_ref != 0.0
        if self._plan is None or not moving.any():
            return
        time = rr.TimeColumn(TIMELINE, duration=block.t[moving])
        along = self._plan.along(block.tilt_ref[moving])
        self._send("normal_force/planned", time, along.w_OC_C[..., N])
        self._send("torque/planned", time, self._shares(along.tau))

    def _send_phases(self, block: Trace) -> None:
        """Mark the rows at which phase or mode change."""
        states = np.column_stack([block.phase, block.mode])
        before = np.vstack([self._state, states[:-1]])
        begun = np.flatnonzero((states != before).any(axis=1))
        self._state = states[-1]
        if begun.size:
            time = rr.TimeColumn(TIMELINE, duration=block.t[begun])
            names = [self._state_name(int(phase), Mode(int(m))) for phase, m in states[begun]]
            self._recording.send_columns("phase", [time], rr.StateChange.columns(state=names))

    def _state_name(self, phase: int, mode: Mode) -> str:
        name = self._scenario.phases[phase].name
        return name if mode is Mode.RUN else f"{mode.name}: {name}"

    def _send_scene(self, block: Trace, history: ContactHistory) -> None:
        first = -round(block.t[0] / self._scenario.physics.timestep) % self._stride
        picked = np.arange(first, len(block), self._stride)
        if not picked.size:
            return
        rows = block.pick(picked)
        time = rr.TimeColumn(TIMELINE, duration=rows.t)
        self._scenery.send_poses(self._recording, rows)
        R_WC = history.R_WC[picked]
        commanded = np.einsum("kmij,kmj->kmi", R_WC, rows.w_commanded_C[..., :3])
        for kind, forces in (("measured", rows.f_W[..., :3]), ("commanded", commanded)):
            columns = arrows(rows.p_WC, _METERS_PER_NEWTON * forces)
            self._recording.send_columns(f"forces/{kind}", [time], columns)
        cones = rows.p_WC[:, :, None] + np.einsum("kmij,mpj->kmpi", R_WC, self._cones)
        self._recording.send_columns("cones", [time], strips(cones))

    def close(self, verdict: str) -> None:
        """Write the verdict, given as Markdown, and complete the file."""
        self._log_text("verdict", verdict)
        self._flush()
        self._recording.disconnect()

    def _flush(self) -> None:
        try:
            self._recording.flush()
        except RuntimeError:  # the viewer may have been closed; the file must be completed
            if not self._streamed:
                raise


def colors(count: int) -> list[tuple[int, ...]]:
    """Return distinct colours, evenly spaced in hue."""
    hues = (np.arange(count) / max(count, 1) + 0.02) % 1.0
    return [tuple(round(255 * x) for x in colorsys.hsv_to_rgb(hue, 0.75, 0.95)) for hue in hues]


def _pale(color: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(round(0.45 * channel + 0.55 * 255) for channel in color)


def _cone(mu: float) -> Array:
    """Return the wire cone of friction mu in contact axes as one strip [m], (p, 3)."""
    angles = np.linspace(0.0, 2.0 * np.pi, _CONE_RAYS, endpoint=False)
    rim = _CONE_LENGTH * np.column_stack(
        [mu * np.cos(angles), mu * np.sin(angles), np.ones(_CONE_RAYS)]
    )
    apex = np.zeros((1, 3))
    # The strip goes up one ray, along the rim, and down the next ray.
    rays = [np.vstack([rim[k : k + 2], apex]) for k in range(0, _CONE_RAYS, 2)]
    return np.vstack([apex, rim, *rays])
