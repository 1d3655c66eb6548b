"""Scenario files that are broken in one place each, and what must be said of them."""

import tomllib
from typing import NamedTuple

from fulcrum.scenarios.reading.file import TEMPLATE

GOOD = TEMPLATE.read_text()
assert tomllib.loads(GOOD)


class Broken(NamedTuple):
    """A change of the good file: what stands in its place, where that is, what must be said."""

    old: str
    new: str
    key: str
    remedy: str


BOX_SIZE = "size_m = [0.3, 0.2, 0.1]"
WEIGHT = "weight_n = 20.0"
ROBOT = 'model = "baxter"'
LEFT_TIP = 'tip = "palm_pad"\nface = "+y"'
LEFT_AT = 'face = "+y"\nat = [0.5, 0.75]'
EDGE = 'edge = ["-x +y -z", "-x -y -z"]'
CYLINDER = 'shape = "hollow-cylinder"\nlength_m = 0.3\n'

BROKEN = {
    "wrong key": Broken("angle_deg", "angel_deg", "path.angel_deg", "angle_deg, perhaps"),
    "wrong table": Broken("[manoeuvre]", "[maneuver]", "maneuver", "manoeuvre, perhaps"),
    "wrong unit": Broken("size_m = [0.3", "size_mm = [300", "object.size_mm", "size_m, perhaps"),
    "no unit": Broken("tilt_s = 8.0", "tilt = 8.0", "manoeuvre.tilt", "tilt_s, perhaps"),
    "number as text": Broken(WEIGHT, 'weight_n = "20"', "object.weight_n", "a number"),
    "text as number": Broken(ROBOT, "model = 3", "robots[0].model", "a string in quotes"),
    "truth as number": Broken("angle_deg = 90.0", "angle_deg = true", "path.angle_deg", "a number"),
    "a date": Broken(WEIGHT, "weight_n = 2026-11-22", "object.weight_n", "a number"),
    "table as number": Broken("friction = { mu = 0.4 }", "friction = 0.4", "friction", "a table"),
    "contact given twice": Broken(
        LEFT_TIP,
        f"contact = {{ stiffness_n_per_m = 4e4, radius_m = 0.03 }}\n{LEFT_TIP}",
        "hands.left.contact.stiffness_n_per_m",
        "left out where there is radius_m",
    ),
    "contact given in part": Broken(
        LEFT_TIP,
        f"contact = {{ youngs_modulus_pa = 2e6, load_n = 50 }}\n{LEFT_TIP}",
        "hands.left.contact.youngs_modulus_pa",
        "together with radius_m",
    ),
    "list of tables": Broken("[manoeuvre]", "[[manoeuvre]]", "manoeuvre", "a table"),
    "one number too few": Broken(BOX_SIZE, "size_m = [0.3, 0.2]", "object.size_m", "3 values"),
    "missing key": Broken(BOX_SIZE, "", "object.size_m", "a value for this key"),
    "missing table": Broken("[path]\n", "[path.extra]\n", "path.extra", "one of"),
    "no hands": Broken("[hands.left]", "[hand.left]", "hand", "hands, perhaps"),
    "unknown shape": Broken('shape = "box"', 'shape = "cube"', "object", "one of box"),
    "unknown kind": Broken('kind = "table"', 'kind = "tabel"', "table.kind", "table, perhaps"),
    "unknown path": Broken(EDGE, f'kind = "twist"\n{EDGE}', "path", "tilt"),
    "unknown after": Broken('after = "leave"', 'after = "leav"', "after", "leave, perhaps"),
    "negative mass": Broken(WEIGHT, "mass_kg = -2", "object.mass_kg", "a number > 0"),
    "no mass": Broken(WEIGHT, "", "object", "exactly one of weight_n, mass_kg"),
    "two masses": Broken(WEIGHT, f"{WEIGHT}\nmass_kg = 2", "object.mass_kg", "exactly one of"),
    "NaN": Broken("[0.65, 0.0, 0.05]", "[0.65, nan, 0.05]", "position_m[1]", "a finite number"),
    "infinite": Broken(WEIGHT, "weight_n = inf", "object.weight_n", "a finite number"),
    "beyond floats": Broken(WEIGHT, "weight_n = 1e999", "object.weight_n", "a finite number"),
    "flat box": Broken(BOX_SIZE, "size_m = [0.3, 0.2, 0]", "object.size_m[2]", "a number > 0"),
    "tilt too far": Broken("angle_deg = 90.0", "angle_deg = 200", "path.angle_deg", "< 180"),
    "inside out normal": Broken(
        LEFT_AT, "point_m = [0, 0.1, 0]\nnormal = [0, 1, 0]", "hands.left.normal", "[0, -1, 0]"
    ),
    "inside out tube": Broken(
        f'shape = "box"\n{BOX_SIZE}',
        f"{CYLINDER}outer_radius_m = 0.1\ninner_radius_m = 0.2",
        "object.inner_radius_m",
        "less than the outer_radius",
    ),
    "zero normal": Broken(
        LEFT_AT, "point_m = [0, 0.1, 0]\nnormal = [0, 0, 0]", "hands.left.normal", "a direction"
    ),
    "tangent along normal": Broken(
        LEFT_AT,
        f"{LEFT_AT}\ntangent = [0, 1, 0]",
        "hands.left.tangent",
        "perpendicular to the",
    ),
    "contact off the surface": Broken(
        LEFT_AT, "point_m = [0, 0.15, 0]", "hands.left.point_m", "the nearest being [0, 0.1, 0]"
    ),
    "contact within": Broken(
        LEFT_AT, "point_m = [0, 0.09, 0]", "hands.left.point_m", "the nearest being [0, 0.1, 0]"
    ),
    "off its face": Broken("at = [0.5, 0.75]", "at = [0.5, 1.75]", "hands.left.at[1]", "<= 1"),
    "face and point": Broken(
        LEFT_AT, f"{LEFT_AT}\npoint_m = [0, 0.1, 0]", "hands.left.point_m", "exactly one of"
    ),
    "no place": Broken(LEFT_AT, "", "hands.left", "exactly one of face, point_m"),
    "unknown face": Broken('face = "+y"', 'face = "side"', "hands.left.face", "one of +x"),
    "may touch nothing": Broken('["+y"]', '["top"]', "hands.left.may_touch", "one of +x"),
    "no such corner": Broken('corner = "-x +y -z"', 'corner = "-x +y"', "corner", '"-x +y -z"'),
    "corner in the air": Broken(
        'corner = "-x +y -z"', 'corner = "-x +y +z"', "edge_left.corner", "the nearest being"
    ),
    "object above the table": Broken(
        "[0.65, 0.0, 0.05]",
        "[0.65, 0.0, 0.07]",
        "edge_left.corner",
        "or object.position_m = [0.65, 0, 0.05]",
    ),
    "object in the table": Broken(
        "[0.65, 0.0, 0.05]",
        "[0.65, 0.0, 0.02]",
        "edge_left.corner",
        "or object.position_m = [0.65, 0, 0.05]",
    ),
    "edge of one corner": Broken(
        EDGE, 'edge = ["-x -y -z", "-x -y -z"]', "path.edge", "two different corners"
    ),
    "edge of points": Broken(
        EDGE,
        "edge = [[0, 0.1, 0], [0, -0.1, 0]]",
        "path.edge[0]",
        "points go into point_m and axis, as those of meshes must",
    ),
    "corner as a point": Broken(
        'corner = "-x +y -z"', "corner = [-0.15, 0.1, -0.05]", "edge_left.corner", "into point_m"
    ),
    "axis and edge": Broken(EDGE, f"{EDGE}\naxis = [0, 1, 0]", "path.axis", "left out"),
    "no axis": Broken(EDGE, "point_m = [0.5, 0, 0]", "path.axis", "a direction"),
    "unknown surface": Broken(
        'surface = "table"', 'surface = "tabel"', "edge_left.surface", "table"
    ),
    "surface without friction": Broken(
        "friction = { mu = 0.4 }", "", "environment.table", "mu = 0.3"
    ),
    "name twice": Broken("[hands.right]", "[hands.edge_left]", "edge_left", "no hand has"),
    "name of the object": Broken("[environment.table]", "[environment.box]", "box", "does not use"),
    "name with a space": Broken("[hands.left]", '[hands."le ft"]', "le ft", "a name of letters"),
    "missing mesh": Broken(
        f'shape = "box"\n{BOX_SIZE}', 'shape = "mesh"\nfile = "a.stl"', "object.file", "that exists"
    ),
    "mesh that is none": Broken(
        f'shape = "box"\n{BOX_SIZE}', 'shape = "mesh"\nfile = "none.stl"', "object.file", "mesh"
    ),
    "missing robot": Broken(ROBOT, 'model = "my.urdf"', "robots[0].model", "that exists"),
    "unknown robot": Broken(ROBOT, 'model = "baxtre"', "robots[0].model", "baxter, perhaps"),
    "robot that is none": Broken(ROBOT, 'model = "none.urdf"', "robots[0].model", ""),
    "unknown tip": Broken(LEFT_TIP, 'tip = "palm"\nface = "+y"', "left.tip", "palm_pad, perhaps"),
    "path leaving the folder": Broken(
        ROBOT, 'model = "../outside.urdf"', "robots[0].model", "--allow-path"
    ),
    "absolute path": Broken(ROBOT, 'model = "/etc/passwd"', "robots[0].model", "--allow-path"),
    "link leaving the folder": Broken(
        ROBOT, 'model = "link.urdf"', "robots[0].model", "--allow-path"
    ),
    "a folder for a file": Broken(ROBOT, 'model = "./"', "robots[0].model", "that exists"),
    "two robots, one prefix": Broken(
        "[path]", '[[robots]]\nmodel = "baxter"\n[path]', "robots[1]", "no other robot has"
    ),
    "wrong joint": Broken("left_s0", "left_s9", "left_s9", "left_s0"),
    "joint twice": Broken(
        "[robots.posture_rad]",
        "[robots.posture_deg]\nleft_s0 = 1\n[robots.posture_rad]",
        "posture_rad.left_s0",
        "in only one posture table",
    ),
    "joint out of range": Broken("left_s0 = -0.06", "left_s0 = -6", "left_s0", "in [-1.7"),
    "wrong mount": Broken('"left_hand_link"', '"left_hand"', "left.mount", "left_hand_link"),
    "wrong still joint": Broken(ROBOT, f'{ROBOT}\nstill = ["s9"]', "robots[0].still", "one of"),
    "no TOML": Broken("tilt_s = 8.0", "tilt_s = 8.0 s", "", "TOML"),
    "key twice": Broken(WEIGHT, f"{WEIGHT}\n{WEIGHT}", "", "TOML"),
    "string without end": Broken('"leave"', '"leave', "", "TOML"),
    "empty file": Broken(GOOD, "", "summary", "a value for this key"),
}
