"""Willow Garage PR2, two arms with grippers, on a base that stands still: 2 × (7 + 1) numbers."""

from dataclasses import replace
from math import pi

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, Fingers, GripperMaterial, JointGroup, RobotDescriptor
from robots.link_pairs import among
from robots.parts import both_sides

# fmt: off
TURNS = (-2 * pi, 2 * pi)  # of joints that turn without end
FINGERS = ("l_finger", "r_finger", "l_finger_tip", "r_finger_tip")
LIMITS = ((-2.3213, 0.0), TURNS, (-2.094, 0.0), TURNS)
LEFT_ARM = JointGroup(
    tuple(f"l_{joint}_joint" for joint in ("shoulder_pan", "shoulder_lift", "upper_arm_roll",
          "elbow_flex", "forearm_roll", "wrist_flex", "wrist_roll")),
    (*(-0.04,) * 4, *(-0.1,) * 3), (*(0.04,) * 4, *(0.1,) * 3),
    stiffness=(9.99e4, 6.59e4, 9510.0, 9940.0, 1000.0, 1000.0, 1000.0),
    damping=(1330.0, 879.0, 127.0, 133.0, 12.7, 10.3, 7.39), delta=True,
    force_limit=(284.0, 188.0, 30.0, 30.0, 30.0, 10.0, 10.0),
    limits=((-0.7146018, 2.2853982), (-0.5236, 1.3963), (-0.8, 3.9), *LIMITS))
RIGHT_ARM = replace(
    LEFT_ARM, joints=tuple(f"r{joint[1:]}" for joint in LEFT_ARM.joints),
    limits=((-2.2853982, 0.7146018), (-0.5236, 1.3963), (-3.9, 0.8), *LIMITS))
TIPS = ("{s}_gripper_l_finger_tip_link", "{s}_gripper_r_finger_tip_link")
LEFT_TIPS = Fingers((TIPS[0].format(s="l"), TIPS[1].format(s="l")), max_angle=110.0)
# The URDF turns one of these against its limits; here all turn alike, as on the robot.
LEFT_GRIPPER = JointGroup(
    tuple(f"l_gripper_{j}_joint" for j in (*FINGERS, "l_parallel_root", "r_parallel_root")), 0.0,
    0.548, stiffness=1e2, damping=1e1, force_limit=100.0, mimic=True, reset_noise=False)
RIGHT_HAND = replace(LEFT_GRIPPER, joints=tuple(f"r{j[1:]}" for j in LEFT_GRIPPER.joints))
LEFT_REST = (0.501771, 0.020107, 2.22013, -1.07038, 0.340878, -0.742479, -0.142704)
RIGHT_REST = (-0.501771, 0.020107, -2.22013, -1.07038, -0.340878, -0.742479, 0.142704)

PR2 = RobotDescriptor(
    name="pr2",
    urdf=UrdfLocator("example_pr2_description", "urdf/pr2.urdf"),
    action_split=ActionSplit(
        left_arm=LEFT_ARM, left_gripper=LEFT_GRIPPER, right_arm=RIGHT_ARM, right_gripper=RIGHT_HAND,
        torso=JointGroup.hold(("torso_lift_joint",), unit="m"),
        head=JointGroup.hold(("head_pan_joint", "head_tilt_joint", "laser_tilt_mount_joint"))),
    tcp_link="l_gripper_tool_frame", fingers=LEFT_TIPS, gripper_material=GripperMaterial(
        tuple(f"{side}_gripper_{f}_link" for side in "lr" for f in FINGERS), 2.0, 2.0, 0.0, 0.1),
    keyframes={"rest": (*LEFT_REST, *(0.548,) * 6, *RIGHT_REST, *(0.548,) * 6, *(0,) * 4)},
    limbs=both_sides("{s}_gripper_tool_frame", 1.001, (-0.05, 0.188, 0.7907),
                     replace(LEFT_TIPS, links=TIPS)),
    reach=1.195,  # of the left TCP, from the URDF
    source="example-robot-data 6.0.0, pr2_description; drives from the inertia behind each joint",
    allowed_collisions=among(
        *(tuple(f"{side}_{part}_link" for part in parts) for side in "lr" for parts in (
            ("shoulder_pan", "shoulder_lift", "upper_arm_roll", "upper_arm"),
            ("upper_arm_roll", "upper_arm", "elbow_flex", "forearm_roll"),
            ("elbow_flex", "forearm_roll", "forearm", "wrist_flex"),
            ("forearm", "wrist_flex", "wrist_roll", "gripper_palm"),
            ("wrist_flex", "wrist_roll", "gripper_palm", "gripper_l_parallel", "gripper_r_parallel",
             *(f"gripper_{finger}" for finger in FINGERS)))),
        *((f"{side}_shoulder_pan_link", "base_link") for side in "lr"),
        *((f"{side}_shoulder_lift_link", "torso_lift_link") for side in "lr"),
        ("double_stereo_link", "head_pan_link")))
