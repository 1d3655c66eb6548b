"""Planned motion of object and arms: schedule, inverse kinematics, references, path time."""

from fulcrum.sim.motion.clock import PathClock
from fulcrum.sim.motion.ik import plan_joints
from fulcrum.sim.motion.joint_path import JointGrid, JointPath, PathError
from fulcrum.sim.motion.references import References
from fulcrum.sim.motion.schedule import Schedule
