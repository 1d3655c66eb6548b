"""Geometry of objects: poses, geoms, shapes, meshes, mass and inertia."""

from fulcrum.sim.geometry.geom import Geom
from fulcrum.sim.geometry.mesh import read_mesh
from fulcrum.sim.geometry.object import GRAVITY, Object, homogeneous
from fulcrum.sim.geometry.pose import Pose, Quaternion, triple, wxyz
from fulcrum.sim.geometry.shape import COLOR, Shape
