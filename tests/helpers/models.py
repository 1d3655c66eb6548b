"""Small robots in URDF and MJCF, and the box's scene with them: shared by the tests of models."""

from dataclasses import replace

from fulcrum.scenarios import scenario

BOX = scenario("box-tilt")
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def scene_with(model, **changes):
    """The box's scene with another robot, held by nobody."""
    robot = replace(BOX.robots[0], model=str(model), posture={}, **changes)
    return replace(BOX, robots=(robot,), hands=())


TWO_LINKS = """
<robot name="two links">
  <material name="blue"><color rgba="0 0 1 1"/></material>
  <link name="foot">{foot}</link>
  <link name="arm">
    <inertial>
      <origin xyz="0 0 0.2"/><mass value="1"/>
      <inertia ixx="0.02" iyy="0.02" izz="0.001" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <visual>
      <geometry><cylinder radius="0.02" length="0.4"/></geometry><material name="blue"/>
    </visual>
  </link>
  <joint name="elbow" type="{kind}">
    <parent link="foot"/><child link="arm"/><axis xyz="0 1 0"/>{limit}
  </joint>
</robot>
"""
LIMIT = '<limit lower="-1" upper="1" effort="20" velocity="2"/>'


def written(folder, text=TWO_LINKS, foot="", kind="revolute", limit=LIMIT):
    file = folder / "robot.urdf"
    file.write_text(text.format(foot=foot, kind=kind, limit=limit))
    return file


def with_elbow(file, **changes):
    """The box's scene with the robot of two links, its elbow driven."""
    scene = scene_with(file, **changes)
    return replace(scene, robots=(replace(scene.robots[0], posture={"elbow": 0.1}),))


FOREIGN = """
<mujoco>
  <option integrator="RK4" density="1000"><flag gravity="disable"/></option>
  <default>
    <geom density="50" margin="0.1" group="1"/>
    <joint damping="0.3" armature="0.2"/>
    <general forcerange="-1 1"/>
  </default>
  <worldbody>
    <light pos="0 0 3"/>
    <geom name="floor" type="plane" size="1 1 1"/>
    <body name="foot" pos="0 0 0.1">
      <geom type="box" size="0.1 0.1 0.1"/>
      <body gravcomp="1">
        <joint name="lift" type="slide" axis="0 0 1" range="0 0.5" user="0.4"
               actuatorfrcrange="-40 40"/>
        <geom type="capsule" size="0.03" fromto="0 0 0 0 0 0.4" mass="2"/>
        <geom type="box" size="0.05 0.05 0.05" contype="0" conaffinity="0"/>
        <body name="hand" pos="0 0 0.4">
          <joint name="turn" axis="0 1 0" user="3"/>
          <joint name="twist" axis="0 0 1" user="3"/>
          <geom type="sphere" size="0.04" mass="0.5"/>
          <site name="palm"/>
        </body>
      </body>
    </body>
  </worldbody>
  <tendon>
    <fixed name="both"><joint joint="turn" coef="1"/><joint joint="twist" coef="1"/></fixed>
  </tendon>
  <equality><joint joint1="turn" joint2="twist"/></equality>
  <actuator>
    <position name="p" joint="turn" kp="100" forcerange="-7 7"/>
    <motor name="m" joint="lift" gear="2" ctrlrange="-30 15" forcerange="-20 50"/>
    <position name="t" tendon="both" forcerange="-3 3"/>
  </actuator>
  <sensor><jointpos joint="turn"/><actuatorfrc actuator="p"/></sensor>
  <keyframe><key qpos="0.1 0 0"/></keyframe>
</mujoco>
"""


def foreign(folder, text=FOREIGN):
    file = folder / "foreign.xml"
    file.write_text(text)
    return file


def driving(file, *joints, **changes):
    scene = scene_with(file, **changes)
    return replace(scene, robots=(replace(scene.robots[0], posture=dict.fromkeys(joints, 0.0)),))
