"""A Panda's hand that flies without an arm: 3 + 3 + 1 action numbers."""

from dataclasses import replace
from math import pi

from robots.assets.locator import UrdfLocator
from robots.catalogue.panda import ARM, PANDA
from robots.descriptor import ActionSplit, Home

ROTATION = replace(
    ARM,
    joints=("root_x_rot_joint", "root_y_rot_joint", "root_z_rot_joint"),
    limits=((-20.0, 20.0),) * 3,
)
POSITION = replace(
    ROTATION, joints=("root_x_axis_joint", "root_y_axis_joint", "root_z_axis_joint"), unit="m"
)

FLOATING_PANDA_GRIPPER = replace(
    PANDA,
    name="floating_panda_gripper",
    urdf=UrdfLocator("maniskill_panda", "panda_v2_gripper.urdf"),
    action_split=ActionSplit(
        position=POSITION, rotation=ROTATION, gripper=PANDA.action_split.groups["gripper"]
    ),
    keyframes={
        "rest": (0, 0, 0, 0, pi, 0, 0.04, 0.04),
        "open_facing_down": (0, 0, 0, 0, pi, 0, 0.04, 0.04),
        "open_facing_up": (0, 0, 0, 0, 0, 0, 0.04, 0.04),
        "open_facing_side": (0, 0, 0, 0, pi / 2, 0, 0.04, 0.04),
    },
    home=Home(position=(0.0, 0.0, 0.5), keyframe="rest"),
    reach=1.0,  # a working size: its joints end at 20 m
    source="mani_skill 3.0.1, agents/robots/floating_panda_gripper/floating_panda_gripper.py",
)
