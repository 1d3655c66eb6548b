"""`fulcrum explain` and `fulcrum capacity`: what limits a scenario, and by how much."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from fulcrum.scenarios.commands import common
from fulcrum.scenarios.commands.terminal import show
from fulcrum.synthesis.render import page, table

# Shares of the capacity that `--confirm` runs: the first is to pass, the second to fail.
_CONFIRMED_SHARES = (0.95, 1.05)
# Steps of the tilt at which the uncertainty that a grip can hold is listed [deg].
_BORNE_DEG = 15.0


@dataclass(frozen=True)
class ExplainCommand(common.Chosen):
    """Explain what limits a scenario at one tilt, by how much, and what to change."""

    controller: str = "margin"
    """Controller whose margins count: robust, margin, paper or no-feedforward."""

    tilt_deg: common.MaybeNumber = None
    """Tilt [deg]; by default the first one without forces, or else the one with least margin."""

    objective: common.MaybeText = None
    """What the synthesis minimises (see `fulcrum list`); by default the scenario's own."""

    json: common.MaybePath = None
    """JSON file for the result."""

    def execute(self) -> int:
        """Run the command; return the exit code: 0 feasible, 1 infeasible."""
        from fulcrum.scenarios import functions
        from fulcrum.scenarios.functions import chosen_control
        from fulcrum.sim.planning import borne
        from fulcrum.sim.run import write_json

        common.check_json(self.json)
        chosen = self.chosen()
        found = functions.explain(chosen, self.tilt_deg, self.controller, self.objective)
        show(found.page(self.controller))
        content = {"controller": self.controller, **dataclasses.asdict(found)}
        control = chosen_control(chosen, self.controller, self.objective)
        if found.feasible and control.robustness is not None:
            scalings = borne(chosen, control, _BORNE_DEG)
            bears = {tilt: scaling.factor for tilt, scaling in scalings.items()}
            rows = [(f"{tilt:g}", f"{100 * factor:.0f}") for tilt, factor in bears.items()]
            show(page(table(("tilt [deg]", "uncertainty that one grip can hold [% of set]"), rows)))
            content["uncertainty_borne"] = bears
        if self.json is not None:
            write_json(self.json, content)
        return common.PASSED if found.feasible else common.FAILED


@dataclass(frozen=True)
class CapacityCommand(common.Chosen):
    """Find the heaviest object that the robots can pivot over the whole path, and can lift."""

    controller: str = "margin"
    """Controller whose margins count: margin, paper or no-feedforward."""

    confirm: bool = False
    """Run the closed loop with 95 % of the capacity (must pass) and 105 % (must fail)."""

    json: common.MaybePath = None
    """JSON file for the result."""

    def execute(self) -> int:
        """Run the command; return the exit code: 1 if a run does not confirm the capacity."""
        from fulcrum.scenarios import functions
        from fulcrum.scenarios.functions import chosen_control
        from fulcrum.sim.evaluation import Verdict
        from fulcrum.sim.run import confirm, write_json

        common.check_json(self.json)
        chosen = self.chosen()
        with common.progress_bar(chosen.name) as progress:
            found = functions.capacity(chosen, self.controller, progress)
        for capacity in found:
            show(capacity.page())
        trials = []
        own = found[0]  # that of the scenario's own manoeuvre
        if self.confirm and 0.0 < own.weight < math.inf:
            control = chosen_control(chosen, self.controller)
            for share in _CONFIRMED_SHARES:
                with common.progress_bar(f"{100 * share:.0f} % of {own.weight:.4g} N") as progress:
                    trial = confirm(chosen, self.controller, control, own.weight, share, progress)
                if trial.verdict is Verdict.INTERRUPTED:
                    return common.INTERRUPTED
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
        return common.PASSED if confirmed else common.FAILED
