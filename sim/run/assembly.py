"""Puts plant, world and controller together into a closed loop."""

from __future__ import annotations

from fulcrum.sim.control import ForceController
from fulcrum.sim.plant import Engine, make_plant
from fulcrum.sim.run.loop import ClosedLoop
from fulcrum.sim.run.preparation import Preparation, prepare
from fulcrum.sim.scenario import Control, Scenario
from fulcrum.sim.world import NO_DEVIATION, Channel, World


def closed_loop(
    scenario: Scenario,
    control: Control,
    prepared: Preparation | None = None,
    world: World = NO_DEVIATION,
    truth: Scenario | None = None,
    seed: int = 0,
    engine: Engine = Engine.MUJOCO,
    best_effort: bool = False,
) -> ClosedLoop:
    """Return a loop that is ready to run.

    Args:
        scenario: What the controller believes.
        control: The controller's settings.
        prepared: What :func:`prepare` gives for both; found here if left out, unchecked.
        world: How the plant deviates from the truth, and what disturbs it; nothing by default.
        truth: What the plant is but for the world; the scenario if left out.
        seed: Draws the deviations of the start posture.
        engine: What simulates the plant.
        best_effort: Whether forces nearest to balance are applied where none balance the object.

    Raises:
        InvalidInputError: The world does not fit the scenario.
        PathError: The arms cannot follow the path.
        RobustInfeasibleError: No grip holds even the nominal object somewhere on the path.
        DivergedError: The start's state is more than numbers can hold.
    """
    prepared = prepared or prepare(scenario, control, best_effort, check=False)
    path, grip = prepared.joint_path, prepared.grip
    truth = world.truth(truth or scenario)
    return ClosedLoop(
        scenario,
        prepared.robot,
        truth,
        make_plant(engine, truth, world),
        ForceController(control, path, grip, Channel(world), best_effort),
        world,
        path.start,
        seed,
    )
