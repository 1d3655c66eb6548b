"""A parallel-jaw gripper tilts the hollow cylinder of Table I about its rim: paper, example 1."""

from sim.scenario import (
    GRAVITY,
    Friction,
    Geom,
    Hand,
    Pivot,
    Pose,
    Robot,
    Scenario,
    Support,
    View,
)
from sim.settings import HOLD, REACH, TILT, Control, Tolerances, stretched
from sim.shape import homogeneous
from sim.shapes import HollowCylinder

# Table I of the paper, and the limit of a finger's force from its text.
WEIGHT = 30.0  # [N]
OUTER, INNER, LENGTH = 0.18, 0.15, 0.5  # [m]: radii; the axis lies along x
FINGER_FRICTION = Friction(mu=0.15, e_n=0.25)
RIM_FRICTION = Friction(mu=0.2)
FINGER_LIMIT = 30.0  # [N]

# Not in the paper: how far the fingers reach over the rim, on the wall opposite to the pivot.
DEPTH = 0.02  # [m]

# With the full friction and 30 N per finger equilibrium exists up to 84.4 deg, with 85 % of the
# friction up to 78.1, with 80 % up to 76.2. The preload costs no range. Without it the outer finger
# does nothing below 54.25 deg, where the weight is over the rim, and lets go; with 5 N the 0.1 N
# that motion adds to tangential forces takes it to 96 % of its friction.
TILT_DEG = 77.0
FRICTION_FACTOR, PRELOAD = 0.85, 10.0
# Softer than usual: at five times that, as with controller `robust`, the fingers keep their margin.
BANDWIDTH = 20.0  # [rad/s]

SHAPE = HollowCylinder(OUTER, INNER, LENGTH, axis="x")
# Three layers of wall may stand before a force's arrow.
_COLOR = (0.80, 0.55, 0.28, 0.22)
# The gripper's: from the wrist's centre to the tips, and finger slides that leave the wall room.
_TIP_TO_WRIST, _FINGER_Q = 0.2, 0.03  # [m]


def _finger(name: str, radius: float, side: float) -> Hand:
    return Hand(
        name=name,
        mount=f"{name}_finger",
        model="finger_tip",
        geom="wall",
        p_OC_O=(LENGTH / 2 - DEPTH, 0.0, radius),
        normal_O=(0.0, 0.0, -side),
        tangent_O=(1.0, 0.0, 0.0),
        friction=FINGER_FRICTION,
        f_n_max=FINGER_LIMIT,
    )


SCENARIO = Scenario(
    name="cylinder-tilt",
    summary="A parallel-jaw gripper tilts a 30 N hollow cylinder about its rim (paper, example 1)",
    object=homogeneous("cylinder", SHAPE, WEIGHT / GRAVITY, _COLOR),
    environment=(
        Geom("floor", "plane", (0.9, 0.7, 0.05), Pose((0.3, 0.0, 0.0)), (0.75, 0.77, 0.80, 1.0)),
    ),
    hands=(_finger("outer", OUTER, 1.0), _finger("inner", INNER, -1.0)),
    supports=(
        Support(
            name="rim",
            geom="rim",
            surface="floor",
            p_OP_O=(-LENGTH / 2, 0.0, -OUTER),
            normal_W=(0.0, 0.0, 1.0),
            tangent_W=(1.0, 0.0, 0.0),
            friction=RIM_FRICTION,
        ),
    ),
    robots=(
        Robot(
            model="gripper",
            posture={
                "slide_x": LENGTH - DEPTH + _TIP_TO_WRIST,
                "slide_y": 0.0,
                "slide_z": OUTER + (OUTER + INNER) / 2,
                "wrist_pitch": 0.0,
                "wrist_yaw": 0.0,
                "wrist_roll": 0.0,
                "outer_finger": _FINGER_Q,
                "inner_finger": _FINGER_Q,
            },
            still=("outer_finger", "inner_finger"),
        ),
    ),
    path=Pivot(
        start=Pose((LENGTH / 2, 0.0, OUTER)),
        point_W=(0.0, 0.0, 0.0),
        axis_W=(0.0, -1.0, 0.0),
        angle_deg=TILT_DEG,
    ),
    phases=stretched((*REACH, *TILT, *HOLD), 10.0),
    standoff=0.02,
    control=Control(friction_factor=FRICTION_FACTOR, preload=PRELOAD, bandwidth=BANDWIDTH),
    tolerances=Tolerances(slip_mm=0.15),
    view=View(eye=(0.45, -1.3, 0.62), target=(0.17, 0.0, 0.38)),
)
