"""Fetch, a mobile manipulator that stands still: 7 + 1 numbers, and 3 for its head and torso."""

from dataclasses import replace
from math import pi

from robots.assets.locator import UrdfLocator
from robots.catalogue import panda
from robots.control_modes import CONTROL_MODES
from robots.descriptor import (
    ActionSplit,
    CameraMount,
    Fingers,
    GripperMaterial,
    Home,
    JointGroup,
    NativeAgent,
)

FINGERS = ("l_gripper_finger_link", "r_gripper_finger_link")
OPEN = (0.015, 0.015)
TURNS = (-2 * pi, 2 * pi)  # of joints that turn without end
ARM = replace(
    panda.ARM,  # the same drives and steps
    joints=(
        "shoulder_pan_joint",
        "shoulder_lift_joint",
        "upperarm_roll_joint",
        "elbow_flex_joint",
        "forearm_roll_joint",
        "wrist_flex_joint",
        "wrist_roll_joint",
    ),
    limits=(
        (-1.6056, 1.6056),
        (-1.221, 1.518),
        TURNS,
        (-2.251, 2.251),
        TURNS,
        (-2.16, 2.16),
        TURNS,
    ),
    reset_noise=False,
    root_link="torso_lift_link",
)
GRIPPER = replace(
    panda.PANDA.action_split.groups["gripper"],
    upper=0.05,
    joints=("l_gripper_finger_joint", "r_gripper_finger_joint"),
)
HEAD, TORSO = ("head_pan_joint", "head_tilt_joint"), ("torso_lift_joint",)
BODY = {  # moves by steps in every control mode
    "head": replace(ARM, joints=HEAD, limits=((-1.57, 1.57), (-0.76, 1.45))),
    "torso": replace(ARM, joints=TORSO, unit="m", limits=((0.0, 0.38615),)),
}
# ManiSkill drives the base by its speed; here it brakes, with the same damping and force.
BASE = JointGroup.hold(("root_z_rotation_joint",), stiffness=0.0, damping=1e3, force_limit=500.0)
SLIDE = replace(BASE, joints=("root_x_axis_joint", "root_y_axis_joint"), unit="m")

FETCH = replace(
    panda.PANDA,
    name="fetch",
    urdf=UrdfLocator("maniskill_fetch", "fetch.urdf"),
    action_split=ActionSplit(arm=ARM, gripper=GRIPPER, **BODY, base_slide=SLIDE, base_turn=BASE),
    tcp_link="gripper_link",
    gripper_material=GripperMaterial(FINGERS, 2.0, 2.0, 0.0, patch_radius=0.1),
    fingers=Fingers(FINGERS, opening_signs=(-1, 1)),
    cameras=(
        CameraMount("fetch_head", link="head_camera_link", fov=2.0),
        CameraMount("fetch_hand", link="gripper_link", position=(-0.1, 0.0, 0.1), fov=2.0),
    ),
    keyframes={  # arm, fingers, head, torso, base
        "rest": (-0.37, -1.032, 0.695, 0.955, -0.1, 2.077, 0, *OPEN, 0, 0.562, 0.386, 0, 0, 0),
        "tabletop": (0, -pi / 4, 0, pi / 4, 0, pi / 3, 0, *OPEN, 0, 0, 0.386, 0, 0, 0),
    },
    home=Home(position=(-1.05, 0.0, -0.9196429), keyframe="tabletop"),  # on the floor
    no_floor_contact=("l_wheel_link", "r_wheel_link"),
    native_agent=NativeAgent(FINGERS, (*SLIDE.joints, *BASE.joints), base_speed=0.05),
    control_modes=dict.fromkeys(CONTROL_MODES, BODY),
    reach=1.13,  # of the TCP, from the URDF
    source="mani_skill 3.0.1, agents/robots/fetch/fetch.py and scene_builder/table",
)
