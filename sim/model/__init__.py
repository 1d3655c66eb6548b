"""Models of the nominal scenario: scene, robots, contacts, object path, statics, inertia."""

from fulcrum.sim.model.collisions import collision_pairs, overlapping_links
from fulcrum.sim.model.contacts import (
    ContactFrames,
    across,
    contact_axes,
    rotations,
    shared_places,
    true_contacts,
)
from fulcrum.sim.model.coupling import coupled_hands
from fulcrum.sim.model.grip import GripSchedule, pressed
from fulcrum.sim.model.inertia import inertial_wrenches
from fulcrum.sim.model.links import DETECTION, Names, distance, is_solid
from fulcrum.sim.model.object_path import ObjectPath, minimum_jerk
from fulcrum.sim.model.robot_model import RobotModel, RobotState
from fulcrum.sim.model.scene import (
    ObjectMotion,
    compose,
    hand_body,
    joint_ranges,
    object_bounds,
    object_pairs,
    pair_materials,
    tip_geom,
    tip_site,
    unwanted_pairs,
)
from fulcrum.sim.model.statics import Statics, gravity
from fulcrum.sim.model.stiffness import set_stiffness
