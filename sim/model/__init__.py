"""The controller's belief as models: scene, robot, contacts, object path, statics, inertia."""

from fulcrum.sim.model.collisions import (
    DETECTION,
    Names,
    collision_pairs,
    distance,
    overlapping_links,
)
from fulcrum.sim.model.contacts import (
    ContactFrames,
    across,
    contact_axes,
    rotations,
    shared_places,
    true_contacts,
)
from fulcrum.sim.model.grip import GripSchedule, pressed
from fulcrum.sim.model.inertia import inertial_wrenches
from fulcrum.sim.model.object_path import ObjectPath, minimum_jerk
from fulcrum.sim.model.robot_model import RobotModel, RobotState
from fulcrum.sim.model.scene import (
    ObjectMotion,
    compose,
    hand_body,
    is_solid,
    joint_ranges,
    object_bounds,
    tip_geom,
    tip_site,
    unwanted_pairs,
)
from fulcrum.sim.model.statics import Statics, gravity
