"""Two UR5 arms pivot a 60 N box about its edge: that of `panda_box.py`, and the same places."""

from scenarios.panda_box import BOX, CONTROL, PATH, TABLE, edge, hand
from sim.scenario import Geom, Pose, Robot, Scenario, View
from sim.settings import LEAVE, REACH, TILT, Physics

# Found by search over place and posture: at least 1.4 rad from every joint limit. The arm has no
# mirror plane, so that each side has its own.
_POSTURES = {
    "left": (-0.847, -0.774, 1.151, -0.377, 2.294, 1.571),
    "right": (0.469, -1.059, 1.395, -0.336, 0.469, 1.571),
}
# The wrists are heavy by their description (0.2 kg m^2): with contacts as stiff as usual the tips
# sink in by a micrometre only, and the turning box leaves them for single steps.
PHYSICS = Physics(solimp=(0.95, 0.95, 0.001))
_JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
_ASIDE = 0.76  # [m] of the bases from the middle


def _arm(name: str, side: float) -> Robot:
    """An arm beside the box, on a stand of the table's height."""
    return Robot(
        model="ur5",
        prefix=f"{name}_",
        base=Pose((-0.07, side * _ASIDE, 0.0)),
        posture={
            f"{joint}_joint": angle for joint, angle in zip(_JOINTS, _POSTURES[name], strict=True)
        },
    )


def _stand(name: str, side: float) -> Geom:
    return Geom(
        f"{name}_stand",
        "cylinder",
        (0.06, 0.25),
        Pose((-0.07, side * _ASIDE, -0.25)),
        rgba=(0.55, 0.57, 0.60, 1.0),
    )


SCENARIO = Scenario(
    name="ur5-box",
    summary="Two UR5 arms pivot a 60 N box about its edge",
    object=BOX,
    environment=(TABLE, _stand("left", 1.0), _stand("right", -1.0)),
    hands=(hand("left", 1.0, "left_tool0"), hand("right", -1.0, "right_tool0")),
    supports=(edge("edge_left", 1.0), edge("edge_right", -1.0)),
    robots=(_arm("left", 1.0), _arm("right", -1.0)),
    path=PATH,
    phases=(*REACH, *TILT, *LEAVE),
    control=CONTROL,
    physics=PHYSICS,
    view=View(eye=(1.5, -1.2, 0.9), target=(0.0, 0.0, 0.15)),
)
