"""Two Franka Panda arms pivot a 60 N box about its edge: more than either of them can lift so."""

import math

from sim.scenario import (
    GRAVITY,
    Friction,
    Geom,
    Hand,
    Object,
    Pivot,
    Pose,
    Robot,
    Scenario,
    Support,
    View,
)
from sim.settings import LEAVE, REACH, TILT, Control

WEIGHT = 60.0  # [N]
LENGTH, WIDTH, HEIGHT = 0.5, 0.35, 0.3  # [m]: along x (away from the edge), y (the edge), z
# Rubber on cardboard, whose patch is some 3 cm wide under the grip; cardboard on wood.
HAND_FRICTION = Friction(mu=0.6, e_n=0.02)
EDGE_FRICTION = Friction(mu=0.4)

# Where the hands press, from the edge [m]: far out, where they need the least force, half-way up.
ALONG, UP = 0.42, 0.15
# The box stands on the edge's side at the end; the table is hardly wider than it, for the elbows.
TABLE = Geom(
    "table", "box", (0.45, 0.2, 0.25), Pose((0.11, 0.0, -0.25)), rgba=(0.75, 0.77, 0.80, 1.0)
)

MASS = WEIGHT / GRAVITY
_SOLID = MASS / 12.0
BOX = Object(
    name="box",
    mass=MASS,
    inertia=(
        _SOLID * (WIDTH**2 + HEIGHT**2),
        _SOLID * (LENGTH**2 + HEIGHT**2),
        _SOLID * (LENGTH**2 + WIDTH**2),
    ),
    geoms=(Geom("box", "box", (LENGTH / 2, WIDTH / 2, HEIGHT / 2), rgba=(0.80, 0.62, 0.40, 0.5)),),
)
PATH = Pivot(
    start=Pose((LENGTH / 2, 0.0, HEIGHT / 2)), point_W=(0.0, 0.0, 0.0), axis_W=(0.0, -1.0, 0.0)
)

# Softer than usual: at five times 30 rad/s, as with controller `robust`, the heavy links' impedance
# against 0.1 mm of sag and slip takes 7 N from the squeeze; at five times 10 rad/s 0.8 N.
CONTROL = Control(bandwidth=10.0)

# Found by search over place and posture: at least 0.8 rad from every joint limit, and the wrists,
# whose 12 N m are what is scarce, as far from their limits as the 88 mm offset of joint 6 allows.
_POSTURE = (0.36, -0.094, 0.441, -1.79, -1.661, 2.339, 1.758)
_MIRRORED = (1, 3, 5, 7)


def hand(name: str, side: float, mount: str) -> Hand:
    """A pad on the box's side face."""
    return Hand(
        name=name,
        mount=mount,
        model="palm_pad",
        geom="box",
        p_OC_O=(ALONG - LENGTH / 2, side * WIDTH / 2, UP - HEIGHT / 2),
        normal_O=(0.0, -side, 0.0),
        tangent_O=(0.0, 0.0, 1.0),
        friction=HAND_FRICTION,
    )


def edge(name: str, side: float) -> Support:
    """An end of the box's edge on the table."""
    return Support(
        name=name,
        geom="box",
        surface="table",
        p_OP_O=(-LENGTH / 2, side * WIDTH / 2, -HEIGHT / 2),
        normal_W=(0.0, 0.0, 1.0),
        tangent_W=(1.0, 0.0, 0.0),
        friction=EDGE_FRICTION,
    )


def _arm(name: str, side: float) -> Robot:
    """An arm beside the box on the floor, facing it."""
    return Robot(
        model="panda",
        prefix=f"{name}_",
        base=Pose((0.0, side * 0.7, -0.5), (math.sqrt(0.5), 0.0, 0.0, -side * math.sqrt(0.5))),
        posture={
            f"panda_joint{i}": side * angle if i in _MIRRORED else angle
            for i, angle in enumerate(_POSTURE, start=1)
        },
    )


SCENARIO = Scenario(
    name="panda-box",
    summary="Two Panda arms pivot a 60 N box about its edge",
    object=BOX,
    environment=(
        TABLE,
        Geom("floor", "plane", (1.0, 1.2, 0.05), Pose((0.1, 0.0, -0.5)), (0.85, 0.86, 0.88, 1.0)),
    ),
    hands=(hand("left", 1.0, "left_panda_link8"), hand("right", -1.0, "right_panda_link8")),
    supports=(edge("edge_left", 1.0), edge("edge_right", -1.0)),
    robots=(_arm("left", 1.0), _arm("right", -1.0)),
    path=PATH,
    phases=(*REACH, *TILT, *LEAVE),
    control=CONTROL,
    view=View(eye=(1.6, -1.2, 0.9), target=(0.0, 0.0, 0.1)),
)
