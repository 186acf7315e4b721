"""Koch v1.1, a small low-cost arm with one moving jaw: 5 + 1 action numbers."""

from dataclasses import replace
from math import cos, pi, sin

from robots.assets.locator import UrdfLocator
from robots.descriptor import (
    ActionSplit,
    Fingers,
    GripperMaterial,
    Home,
    JointGroup,
    RobotDescriptor,
    names,
)

JAWS = ("gripper", "link_6")
FULL_TURN = (-3.14159, 3.14159)
ARM = JointGroup(
    names("joint_", 1, 5),
    lower=(-0.05, -0.05, -0.05, -0.05, -0.1),
    upper=(0.05, 0.05, 0.05, 0.05, 0.1),
    delta=True,
    stiffness=(123.0, 50.0, 102.68, 145.0, 108.37),  # measured on a real arm
    damping=(15.85, 6.0, 15.34, 16.0, 16.31),
    force_limit=100.0,
    limits=(FULL_TURN, (0.0, 2.2), (0.0, 3.05), (-1.5, 2.14159), FULL_TURN),
)
JAW = JointGroup(("joint_6",), -0.05, 0.05, 93.3, 16.3, 100.0, delta=True, limits=((0.0, 1.6),))

KOCH = RobotDescriptor(
    name="koch",  # ManiSkill calls it koch-v1.1
    urdf=UrdfLocator("maniskill_koch", "follower_arm_v1.1.urdf"),
    action_split=ActionSplit(arm=ARM, gripper=JAW),
    control_modes={
        "pd_joint_pos": {
            "arm": replace(ARM.by_position(), stiffness=1e3, damping=1e2),
            "gripper": replace(JAW.by_position(), stiffness=100.0, damping=1.0),
        }
    },
    tcp_link="gripper_tcp",
    gripper_material=GripperMaterial(JAWS, 0.3, 0.3, 0.0, patch_radius=0.1),
    fingers=Fingers(links=JAWS, max_angle=110.0),  # the moving jaw swings, it does not slide
    keyframes={
        "rest": (0, 2.2, 3.017, -0.25, 0, 0.6044),
        "elevated_turn": (0, 2.2, 2.75, -0.25, -pi / 2, 1.0),
        "zero": (0, 0, 0, 0, 0, 0),
    },
    # No scene of ManiSkill's has one; the place is a guess, the quarter turn its keyframes'.
    home=Home(position=(-0.3, 0.0, 0.0), quaternion=(cos(pi / 4), 0.0, 0.0, sin(pi / 4))),
    reach=0.39,  # of the TCP, from the URDF
    source="mani_skill 3.0.1, agents/robots/koch/koch.py",
)
