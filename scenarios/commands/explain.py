"""The commands that ask why and how much: ``fulcrum explain`` and ``fulcrum capacity``."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path

from fulcrum.scenarios.commands.common import (
    FAILED,
    INTERRUPTED,
    PASSED,
    Chosen,
    check_json,
    chosen_control,
    progress_bar,
)
from fulcrum.scenarios.commands.terminal import show
from fulcrum.synthesis.render import Page, page, table

# Shares of the capacity that `--confirm` runs: the first is to pass, the second to fail.
_CONFIRMED_SHARES = (0.95, 1.05)
# Steps of the tilt at which it is said how much uncertainty a grip bears [deg].
_BORNE_DEG = 15.0


@dataclass(frozen=True)
class ExplainCommand(Chosen):
    """Say why a scenario's problem has no solution and what would help, or how much it bears."""

    controller: str = "margin"
    """Whose margins count: robust, margin, paper or no-feedforward."""

    tilt_deg: float | None = None
    """Tilt [deg]; the first infeasible or else tightest one if left out."""

    objective: str | None = None
    """What the synthesis minimises (see `fulcrum list`); the scenario's own if left out."""

    json: Path | None = None
    """File for the result as JSON."""

    def execute(self) -> int:
        """Does it; returns the exit code: 0 feasible, 1 infeasible."""
        from fulcrum.sim.analysis import tightest_tilt
        from fulcrum.sim.analysis.explain import explain
        from fulcrum.sim.planning import PathProblems, borne
        from fulcrum.sim.run import write_json
        from fulcrum.synthesis import Synthesizer

        check_json(self.json)
        chosen = self.chosen()
        control = chosen_control(chosen, self.controller, self.objective)
        problems, synthesizer = PathProblems(chosen, control), Synthesizer()
        tilt = self.tilt_deg
        if tilt is None:
            tilt = tightest_tilt(problems, synthesizer)
        explanation = explain(problems, tilt, synthesizer)
        show(explanation.page(self.controller))
        content = dataclasses.asdict(explanation)
        if explanation.feasible and control.robustness is not None:
            scalings = borne(chosen, control, _BORNE_DEG, problems.joint_path)
            bears = {tilt: scaling.factor for tilt, scaling in scalings.items()}
            show(_borne_page(bears))
            content["uncertainty_borne"] = bears
        if self.json is not None:
            write_json(self.json, {"controller": self.controller, **content})
        return PASSED if explanation.feasible else FAILED


@dataclass(frozen=True)
class CapacityCommand(Chosen):
    """Find the heaviest object that the robot can pivot over the whole path, and can lift."""

    controller: str = "margin"
    """Whose margins count: margin, paper or no-feedforward."""

    confirm: bool = False
    """Run the closed loop with 95 % and with 105 % of the capacity."""

    json: Path | None = None
    """File for the result as JSON."""

    def execute(self) -> int:
        """Does it; returns the exit code: 1 if a run does not confirm what was found."""
        from fulcrum.sim.analysis import capacities
        from fulcrum.sim.evaluation import Verdict
        from fulcrum.sim.run import confirm, write_json

        check_json(self.json)
        chosen = self.chosen()
        control = chosen_control(chosen, self.controller, None)
        with progress_bar(chosen.name) as progress:
            found = capacities(chosen, control, progress)
        for capacity in found:
            show(capacity.page())
        trials = []
        # The scenario's own manoeuvre comes first.
        own = found[0]
        if self.confirm and 0.0 < own.weight < math.inf:
            for share in _CONFIRMED_SHARES:
                with progress_bar(f"{100 * share:.0f} % of {own.weight:.4g} N") as progress:
                    trial = confirm(chosen, self.controller, control, own.weight, share, progress)
                if trial.verdict is Verdict.INTERRUPTED:
                    return INTERRUPTED
                trials.append(trial)
                show(trial.page())
        if self.json is not None:
            content = {
                "scenario": chosen.name,
                "controller": self.controller,
                "capacities": [dataclasses.asdict(capacity) for capacity in found],
                "trials": [dataclasses.asdict(trial) for trial in trials],
            }
            write_json(self.json, content)
        confirmed = all((t.verdict is Verdict.PASS) is (t.share < 1.0) for t in trials)
        return PASSED if confirmed else FAILED


def _borne_page(bears: dict[float, float]) -> Page:
    """The largest scaling of the controller's uncertainty set that one grip bears, by tilt."""
    rows = [(f"{tilt:g}", f"{100 * factor:.0f}") for tilt, factor in bears.items()]
    return page(table(("tilt [deg]", "uncertainty that one grip bears [% of the set]"), rows))
