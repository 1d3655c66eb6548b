"""Baxter tips a box against a wall that keeps its foot from sliding, until it leans there."""

import math

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
    Vector,
    View,
)
from sim.settings import LEAVE, REACH, TILT, Tolerances, stretched
from sim.shape import homogeneous
from sim.shapes import Box

WEIGHT = 50.0  # [N]
DEPTH, WIDTH, HEIGHT = 0.2, 0.3, 0.35  # [m]: along x (away from the robot), y (the edge), z
# Rubber palms; a table so smooth that the foot would slide off, and a wall.
PALM_FRICTION = Friction(mu=0.5, e_n=0.5)
TABLE_FRICTION, WALL_FRICTION = Friction(mu=0.1), Friction(mu=0.3)
# Harder the palms would drive the foot up the wall before the box has tipped.
PALM_LIMIT = 45.0  # [N]

# Both palms press on the face before the robot, as low as they must be to hold the box back when
# its weight is over the edge, from 29.7 deg on: by friction down the face.
FACE_X = 0.665  # [m] in front of Baxter's torso frame
UP, APART = 0.04, 0.206  # [m]: above the table, and from each other
# The wall leans back: in a corner of 90 deg an edge of 90 deg has no room to turn. At this tilt
# the box lies on the wall and stays there.
LEAN = math.radians(32.0)
# The table ends with the box, so that wrists have room before it.
TABLE_LENGTH, TABLE_WIDTH, THICKNESS = 0.3, 0.34, 0.04  # [m]
WALL_HEIGHT, WALL_BELOW = 0.4, 0.03  # [m]: along its slope, and how much of it is below the table

_POSTURE = {"s0": 0.26, "s1": 0.88, "e0": -0.79, "e1": 1.95, "w0": -2.02, "w1": 1.36, "w2": -1.71}
_MIRRORED = ("s0", "e0", "w0", "w2")
_EDGE_X = FACE_X + DEPTH
_UP_WALL = (math.sin(LEAN), 0.0, math.cos(LEAN))
_OFF_WALL = (-math.cos(LEAN), 0.0, math.sin(LEAN))


def _palm(name: str, side: float) -> Hand:
    return Hand(
        name=name,
        mount=f"{name}_hand_link",
        model="palm_pad",
        geom="box",
        p_OC_O=(-DEPTH / 2, side * APART / 2, UP - HEIGHT / 2),
        normal_O=(1.0, 0.0, 0.0),
        tangent_O=(0.0, 0.0, -1.0),
        friction=PALM_FRICTION,
        f_n_max=PALM_LIMIT,
    )


def _support(
    name: str, side: float, surface: str, normal: Vector, tangent: Vector, friction: Friction
) -> Support:
    p_OP_O = (DEPTH / 2, side * WIDTH / 2, -HEIGHT / 2)
    return Support(name, "box", surface, p_OP_O, normal, tangent, friction)


def _on_table(name: str, side: float) -> Support:
    return _support(name, side, "table", (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), TABLE_FRICTION)


def _on_wall(name: str, side: float) -> Support:
    return _support(name, side, "wall", _OFF_WALL, _UP_WALL, WALL_FRICTION)


def _wall() -> Geom:
    """A slab whose face goes through the edge that the box turns about."""
    up, back = WALL_HEIGHT / 2 - WALL_BELOW, THICKNESS / 2
    middle = (_EDGE_X + up * _UP_WALL[0] - back * _OFF_WALL[0], 0.0)
    return Geom(
        "wall",
        "box",
        (THICKNESS / 2, TABLE_WIDTH / 2, WALL_HEIGHT / 2),
        Pose(
            (*middle, up * _UP_WALL[2] - back * _OFF_WALL[2]),
            (math.cos(LEAN / 2), 0.0, math.sin(LEAN / 2), 0.0),
        ),
        rgba=(0.62, 0.66, 0.72, 1.0),
    )


SCENARIO = Scenario(
    name="box-wall",
    summary="Baxter tips a 50 N box on a smooth table until it leans on the wall behind it",
    object=homogeneous("box", Box((DEPTH, WIDTH, HEIGHT)), WEIGHT / GRAVITY),
    environment=(
        Geom(
            "table",
            "box",
            (TABLE_LENGTH / 2, TABLE_WIDTH / 2, THICKNESS / 2),
            Pose((FACE_X + TABLE_LENGTH / 2, 0.0, -THICKNESS / 2)),
            rgba=(0.75, 0.77, 0.80, 1.0),
        ),
        _wall(),
    ),
    hands=(_palm("left", 1.0), _palm("right", -1.0)),
    supports=(
        _on_table("foot_left", 1.0),
        _on_table("foot_right", -1.0),
        _on_wall("wall_left", 1.0),
        _on_wall("wall_right", -1.0),
    ),
    robots=(
        Robot(
            model="baxter",
            posture={
                f"{side}_{joint}": -angle if side == "right" and joint in _MIRRORED else angle
                for side in ("left", "right")
                for joint, angle in _POSTURE.items()
            },
        ),
    ),
    path=Pivot(
        start=Pose((FACE_X + DEPTH / 2, 0.0, HEIGHT / 2)),
        point_W=(_EDGE_X, 0.0, 0.0),
        axis_W=(0.0, 1.0, 0.0),
        angle_deg=math.degrees(LEAN),
    ),
    phases=stretched((*REACH, *TILT, *LEAVE), 5.0),
    # Table and wall hold the same edge. How they share its load is not for statics to say: what
    # one takes more the other takes less, up to its friction, while the edge stays where it is.
    tolerances=Tolerances(utilisation=1.01, force_error=0.5),
    view=View(eye=(0.2, -1.4, 0.7), target=(-0.15, 0.0, 0.15)),
)
