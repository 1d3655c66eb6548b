"""Baxter stands a cylinder that lies on its side up on its end, between both palms."""

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
)
from sim.settings import LEAVE, REACH, TILT
from sim.shape import homogeneous
from sim.shapes import Cylinder

WEIGHT = 30.0  # [N]
RADIUS, LENGTH = 0.07, 0.3  # [m]; the axis lies along x, away from the robot
# Rubber palms on a smooth wall; its rim on the table.
PALM_FRICTION = Friction(mu=0.3, e_n=0.1)
RIM_FRICTION = Friction(mu=0.3)

ALONG = 0.225  # [m] from the end it turns about to the palms, which press at the height of the axis
RIM_X = 0.5  # [m] in front of Baxter's torso frame
TABLE_LENGTH, TABLE_WIDTH, TABLE_THICKNESS = 0.5, 0.16, 0.04  # [m]

_POSTURE = {"s0": -0.06, "s1": 0.37, "e0": -1.17, "e1": 0.73, "w0": -0.07, "w1": 1.50, "w2": -1.03}
_MIRRORED = ("s0", "e0", "w0", "w2")


def _palm(name: str, side: float) -> Hand:
    return Hand(
        name=name,
        mount=f"{name}_hand_link",
        model="palm_pad",
        geom="cylinder",
        p_OC_O=(ALONG - LENGTH / 2, side * RADIUS, 0.0),
        normal_O=(0.0, -side, 0.0),
        tangent_O=(0.0, 0.0, 1.0),
        friction=PALM_FRICTION,
    )


SCENARIO = Scenario(
    name="cylinder-side",
    summary="Baxter stands a 30 N cylinder that lies on its side up on its end",
    object=homogeneous("cylinder", Cylinder(RADIUS, LENGTH, axis="x"), WEIGHT / GRAVITY),
    environment=(
        Geom(
            "table",
            "box",
            (TABLE_LENGTH / 2, TABLE_WIDTH / 2, TABLE_THICKNESS / 2),
            Pose((RIM_X + 0.1, 0.0, -TABLE_THICKNESS / 2)),
            rgba=(0.75, 0.77, 0.80, 1.0),
        ),
        # What the cylinder touches: on a plane MuJoCo knows a cylinder's contact points exactly, on
        # a cuboid the rim lets go for a step where its end comes down.
        Geom(
            "top",
            "plane",
            (TABLE_LENGTH / 2, TABLE_WIDTH / 2, 0.05),
            Pose((RIM_X + 0.1, 0.0, 0.0)),
            rgba=(0.0, 0.0, 0.0, 0.0),
            solid=False,
        ),
    ),
    hands=(_palm("left", 1.0), _palm("right", -1.0)),
    supports=(
        Support(
            name="rim",
            geom="cylinder",
            surface="top",
            p_OP_O=(-LENGTH / 2, 0.0, -RADIUS),
            normal_W=(0.0, 0.0, 1.0),
            tangent_W=(1.0, 0.0, 0.0),
            friction=RIM_FRICTION,
        ),
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
        start=Pose((RIM_X + LENGTH / 2, 0.0, RADIUS)),
        point_W=(RIM_X, 0.0, 0.0),
        axis_W=(0.0, -1.0, 0.0),
    ),
    phases=(*REACH, *TILT, *LEAVE),
)
