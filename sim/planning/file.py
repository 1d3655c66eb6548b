"""A plan as plain data for its file: timing, forces, torques, and the active limits."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from fulcrum.sim.planning.plan import Plan


def plan_content(plan: Plan) -> dict[str, Any]:
    """Return all data of a plan for JSON; rows of stations are the two ends of every interval."""
    found, problem = plan.solution, plan.solution.problem
    point = problem.stations[:, 0]
    a, b = found.motion
    end = np.radians(plan.scenario.path.angle_deg)
    s = problem.s
    contacts = [contact.name for contact in problem.loads[0].problems[0].contacts]
    return {
        "scenario": plan.scenario.name,
        "objective": problem.objective.value,
        "value": found.value,
        "duration_s": plan.duration,
        "loads": len(problem.loads),
        "share_of_uncertainty": plan.share,
        "margins": dataclasses.asdict(plan.margins),
        "residuals": dataclasses.asdict(found.residuals),
        "solver": {"solve_s": found.solve_s, "iterations": found.iterations},
        "joints": list(plan.joints),
        "contacts": contacts,
        "grid": {
            "t_s": plan.times.tolist(),
            "tilt_deg": np.degrees(plan.tilt).tolist(),
            "rate_rad_s": (np.sqrt(found.b) * end).tolist(),
            "q": plan.q(s).tolist(),
            "qd": (plan.q(s, 1) * np.sqrt(found.b)[:, None]).tolist(),
        },
        "stations": {
            "t_s": plan.times[point].tolist(),
            "tilt_deg": np.degrees(plan.tilt[point]).tolist(),
            "acceleration_rad_s2": (a * end).tolist(),
            "rate_rad_s": (np.sqrt(b) * end).tolist(),
            "wrench_contact_axes": [load.tolist() for load in found.w_OC_C],
            "torque": [load.tolist() for load in found.tau],
        },
        "active": [
            {"from_deg": low, "to_deg": high, "limits": list(limits)}
            for low, high, limits in plan.stretches()
        ],
    }
