"""Franka Emika Panda with its two-finger hand: 7 + 1 action numbers."""

from math import pi

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

FINGERS = ("panda_leftfinger", "panda_rightfinger")
ARM = JointGroup(
    names("panda_joint", 1, 7),
    lower=-0.1,
    upper=0.1,
    delta=True,
    stiffness=1e3,
    damping=1e2,
    force_limit=100.0,
    limits=(
        (-2.8973, 2.8973),
        (-1.7628, 1.7628),
        (-2.8973, 2.8973),
        (-3.0718, -0.0698),
        (-2.8973, 2.8973),
        (-0.0175, 3.7525),
        (-2.8973, 2.8973),
    ),
)

PANDA = RobotDescriptor(
    name="panda",
    urdf=UrdfLocator("maniskill_panda", "panda_v2.urdf"),
    action_split=ActionSplit(
        arm=ARM,
        gripper=JointGroup(
            ("panda_finger_joint1", "panda_finger_joint2"),
            mimic=True,
            unit="m",
            lower=-0.01,  # below zero, so that thin objects are squeezed
            upper=0.04,
            stiffness=1e3,
            damping=1e2,
            force_limit=100.0,
            reset_noise=False,
        ),
    ),
    tcp_link="panda_hand_tcp",
    gripper_material=GripperMaterial(FINGERS, 2.0, 2.0, 0.0, patch_radius=0.1),
    fingers=Fingers(FINGERS),
    keyframes={"rest": (0, pi / 8, 0, -5 * pi / 8, 0, 3 * pi / 4, pi / 4, 0.04, 0.04)},
    home=Home(position=(-0.615, 0.0, 0.0)),  # mani_skill 3.0.1, scene_builder/table
    reach=0.855,  # Franka Emika Panda data sheet, 2020
    source="mani_skill 3.0.1, agents/robots/panda/panda.py",
)
