"""The plant in Drake, with contacts solved by SAP; scene and world are those for MuJoCo."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    ExternallyAppliedSpatialForce,
    MultibodyPlantConfig,
)
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from fulcrum.sim.model import compose
from fulcrum.sim.plant.drake_contacts import Contacts
from fulcrum.sim.plant.drake_log import DrakeLog
from fulcrum.sim.plant.drake_model import Bodies
from fulcrum.sim.plant.protocol import DivergedError
from fulcrum.sim.plant.truth import make_true
from fulcrum.sim.scenario import Scenario
from fulcrum.sim.signals import AppliedForce, Measurement, Trace
from fulcrum.sim.world import NO_DEVIATION, World
from fulcrum.synthesis.arrays import Array


class DrakePlant:
    """A scenario's truth in Drake; implements :class:`sim.plant.protocol.Plant`.

    Attributes:
        joints: Names of the driven joints, in the order of the motors.
    """

    def __init__(
        self,
        scenario: Scenario,
        world: World = NO_DEVIATION,
    ) -> None:
        """Build the scene.

        Args:
            scenario: True object, contacts and environment.
            world: True deviations of the robots; none by default.

            Raises:
                InvalidInputError: Scenario and world are inconsistent, or require features that
                    this plant does not have.
        """
        scene = compose(scenario).compile()
        make_true(scene, scenario, world)
        drives = [scene.actuator(i) for i in range(scene.nu)]
        self.joints = tuple(scene.joint(int(drive.trnid[0])).name for drive in drives)
        self._limits = np.array([drive.ctrlrange for drive in drives]).T
        self._dt, self._steps = scenario.physics.timestep, 0
        builder = DiagramBuilder()
        config = MultibodyPlantConfig(
            time_step=self._dt,
            discrete_contact_approximation="sap",
            contact_model="point",
        )
        self._plant, graph = AddMultibodyPlant(config, builder)
        plant = self._plant
        bodies = Bodies(plant, scene)
        contacts = Contacts(plant, scenario, scene, bodies)
        plant.Finalize()
        for declaration in contacts.filters():
            graph.collision_filter_manager().Apply(declaration)
        self._object = plant.GetBodyByName(scenario.object.name)
        self._start, self._center = scenario.path.start, np.array(scenario.object.center_of_mass)
        joints = [bodies.joints[name] for name in self.joints]
        self._q = [joint.position_start() for joint in joints]
        self._qd = [joint.velocity_start() for joint in joints]
        self._pose = self._object.floating_positions_start()
        self._u = [bodies.motors[name].input_start() for name in self.joints]
        self._tau = np.zeros(len(self.joints))
        self._actuation = np.zeros(plant.num_actuators())
        self._simulator = Simulator(builder.Build())
        self._context = plant.GetMyMutableContextFromRoot(self._simulator.get_mutable_context())
        instance = self._object.model_instance()
        if bodies.controlled:
            still = np.zeros(2 * plant.num_actuators())
            plant.get_desired_state_input_port(instance).FixValue(self._context, still)
        self._pushed = False
        self._log = DrakeLog(scenario, plant, contacts)

    @property
    def collisions(self) -> dict[tuple[str, str], float]:
        """Time of the first contact [s] of each unwanted pair of geoms."""
        return self._log.collisions

    def reset(self, q: Array) -> None:
        """See :meth:`Plant.reset`."""
        plant, context = self._plant, self._context
        positions, start = np.zeros(plant.num_positions()), self._start
        positions[self._q] = q
        quaternion = np.asarray(start.quaternion)
        positions[self._pose : self._pose + 4] = quaternion / np.linalg.norm(quaternion)
        positions[self._pose + 4 : self._pose + 7] = start.position
        self._simulator.get_mutable_context().SetTime(0.0)
        plant.SetPositions(context, positions)
        plant.SetVelocities(context, np.zeros(plant.num_velocities()))
        self._steps = 0
        self.apply(np.zeros(len(self.joints)))
        self._log.clear()
        self._simulator.Initialize()

    def measure(self) -> Measurement:
        """See :meth:`Plant.measure`."""
        q = self._plant.GetPositions(self._context)
        qd = self._plant.GetVelocities(self._context)
        at = self._pose
        turn, p_WO = q[at : at + 4], q[at + 4 : at + 7]
        quat_WO = turn / np.linalg.norm(turn)  # its length drifts in Drake
        t = self._steps * self._dt
        return Measurement(t, q[self._q], qd[self._qd], p_WO, quat_WO, self._tau.copy())

    def apply(self, tau: Array, forces: Sequence[AppliedForce] = ()) -> None:
        """See :meth:`Plant.apply`."""
        self._tau = np.clip(tau, *self._limits)
        self._actuation[self._u] = self._tau
        plant = self._plant
        plant.get_actuation_input_port().FixValue(self._context, self._actuation)
        if forces or self._pushed:
            port = plant.get_applied_spatial_force_input_port()
            port.FixValue(self._context, [self._external(force) for force in forces])
        self._pushed = bool(forces)

    def _external(self, force: AppliedForce) -> ExternallyAppliedSpatialForce:
        external = ExternallyAppliedSpatialForce()
        external.body_index = self._object.index()
        external.p_BoBq_B = self._center if force.p_OA_O is None else force.p_OA_O
        external.F_Bq_W = SpatialForce(tau=np.zeros(3), f=force.force_W)
        return external

    def step(self) -> None:
        """See :meth:`Plant.step`."""
        self._log.before(self._context)
        self._steps += 1
        try:
            self._simulator.AdvanceTo(self._steps * self._dt)
        except RuntimeError as error:
            raise DivergedError(self._steps * self._dt) from error
        if not np.isfinite(self._plant.GetPositionsAndVelocities(self._context)).all():
            raise DivergedError(self._steps * self._dt)
        self._log.after(self._context)

    def contacts(self, block: Trace) -> None:
        """See :meth:`Plant.contacts`."""
        self._log.read(block)
