"""SO-100 by TheRobotStudio, a small arm with one moving jaw: 5 + 1 action numbers."""

from math import cos, pi, sin

from robots.assets.locator import UrdfLocator
from robots.descriptor import (
    ActionSplit,
    Fingers,
    GripperMaterial,
    Home,
    JointGroup,
    RobotDescriptor,
)

QUARTER = (-1.5708, 1.5708)
JAWS = ("Fixed_Jaw", "Moving_Jaw")

SO100 = RobotDescriptor(
    name="so100",
    urdf=UrdfLocator("maniskill_so100", "so100.urdf"),
    action_split=ActionSplit(
        arm=JointGroup(
            ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"),
            lower=-0.05,  # half a Panda's: the real arm shakes when it moves faster
            upper=0.05,
            delta=True,
            stiffness=1e3,
            damping=1e2,
            force_limit=100.0,
            limits=((-2.0, 2.0), QUARTER, QUARTER, (-1.8, 1.8), (-3.14159, 3.14159)),
        ),
        gripper=JointGroup(
            ("gripper",),
            lower=-0.2,
            upper=0.2,
            delta=True,
            stiffness=1e3,
            damping=1e2,
            force_limit=100.0,
            limits=((-1.1, 1.1),),
        ),
    ),
    tcp_link="Fixed_Jaw",
    tcp_position_links=("Fixed_Jaw_tip", "Moving_Jaw_tip"),
    gripper_material=GripperMaterial(JAWS, 2.0, 2.0, 0.0, patch_radius=0.1),
    fingers=Fingers(links=JAWS, max_angle=110.0),  # the moving jaw swings, it does not slide
    keyframes={
        "rest": (0, -1.5708, 1.5708, 0.66, 0, -1.1),
        "zero": (0, 0, 0, 0, 0, 0),
        "tabletop": (0, 0, 0, pi / 2, pi / 2, 0),  # jaws down, over the cube
    },
    home=Home(  # the arm reaches out along its own -y
        position=(-0.725, 0.0, 0.0),
        quaternion=(cos(pi / 4), 0.0, 0.0, sin(pi / 4)),
        keyframe="tabletop",
    ),
    reach=0.44,
    source="mani_skill 3.0.1, agents/robots/so100/so_100.py and scene_builder/table",
)
