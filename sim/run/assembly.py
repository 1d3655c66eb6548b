"""The closed loop, made from plant, world and controller."""

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
        scenario: Scenario that the controller assumes.
        control: Settings of the controller.
        prepared: Result of :func:`prepare` for both; computed here without checks if left out.
        world: Deviations and disturbances of the plant; none by default.
        truth: Scenario that the plant has before the world is applied; by default `scenario`.
        seed: Seed of the deviations of the start posture.
        engine: Engine that simulates the plant.
        best_effort: Whether to apply the forces nearest to balance where none balance the object.

    Raises:
        InvalidInputError: The world does not fit the scenario.
        PathError: The arms cannot follow the path.
        RobustInfeasibleError: No grip holds even the nominal object somewhere on the path.
        DivergedError: The state at the start is not finite.
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
