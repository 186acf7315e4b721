"""PAL Robotics TIAGo Pro, two arms, on a base that stands still: 2 × (7 + 1) action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, JointGroup, RobotDescriptor
from robots.link_pairs import among
from robots.parts import both_sides

# fmt: off
SIDES, ENDS = ("left", "right"), ("front", "rear")
BEND, WRIST, TURN = (-2.443461, 1.134464), (-1.8849556, 3.0019662), (-2.6179938, 2.6179938)
TIPS = tuple(f"gripper_{{side}}_fingertip_{finger}_link" for finger in SIDES)
OPEN = 0.80285144  # rad
WHEELS = tuple(f"wheel_{end}_{side}" for end in ENDS for side in SIDES)
BASE = ("base_link", "base_antenna_left_link", "base_antenna_right_link", "base_dock_link",
        "base_front_laser_link", "base_rear_laser_link", "torso_base_link",
        *(f"suspension{wheel[5:]}_link" for wheel in WHEELS))
PARTS = ("finger", "inner_finger_left", "outer_finger_right", "inner_finger_right",
         "fingertip_left", "fingertip_right")
JOINTS = {side: tuple(f"gripper_{side}_{part}_joint" for part in PARTS) for side in SIDES}
LEFT_ARM = JointGroup(
    tuple(f"arm_left_{i}_joint" for i in range(1, 8)),
    lower=(*(-0.04,) * 4, *(-0.1,) * 3), upper=(*(0.04,) * 4, *(0.1,) * 3),
    stiffness=(2.57e4, 3.23e4, 8480.0, 7940.0, 1000.0, 1000.0, 1000.0),
    damping=(343.0, 431.0, 113.0, 106.0, 7.94, 8.06, 1.61),
    force_limit=(73.1, 92.0, 26.0, 26.0, 26.0, 26.0, 26.0), delta=True,
    limits=((-0.5235988, 4.712389), BEND, TURN, BEND, (-3.6651914, 1.5707964), WRIST, TURN))
RIGHT_ARM = replace(
    LEFT_ARM, joints=tuple(f"arm_right_{i}_joint" for i in range(1, 8)),
    limits=((-4.712389, 0.5235988), BEND, TURN, BEND, (-1.5707964, 3.6651914), WRIST, TURN))
GRIPPER = JointGroup(  # one motor moves both linkages
    JOINTS["left"], 0.0, OPEN, stiffness=2.0, damping=0.1, force_limit=10.0, mimic=True,
    multipliers=(-1, -1, -1, -1, 1, 1), offsets=(*(OPEN,) * 4, *(-OPEN,) * 2), reset_noise=False)

TIAGO_PRO = RobotDescriptor(
    name="tiago_pro",
    urdf=UrdfLocator("example_tiago_pro_description", "robots/tiago_pro.urdf"),
    action_split=ActionSplit(
        left_arm=LEFT_ARM, left_gripper=GRIPPER, right_arm=RIGHT_ARM,
        right_gripper=replace(GRIPPER, joints=JOINTS["right"]),
        torso=JointGroup.hold(("torso_lift_joint",), unit="m"),
        head=JointGroup.hold(("head_1_joint", "head_2_joint")),
        wheels=JointGroup.hold(tuple(f"{wheel}_joint" for wheel in WHEELS))),
    tcp_link="gripper_left_base_link",
    tcp_position_links=tuple(link.format(side="left") for link in TIPS),
    keyframes={"rest": (0.343331, 0.067992, 0.503395, -0.938694, -1.153419, 2.114344, 0.018755,
                        *(0,) * 6, -0.498625, 0.597775, 1.222533, 0.340459, -0.694559, 1.880084,
                        0.630249, *(0,) * 13)},
    limbs=both_sides("gripper_{side}_base_link", 1.032, (0.0653, 0.1592, 0.7537), None, TIPS),
    reach=1.2,  # of the left TCP, from the URDF
    source="example-robot-data 6.0.0, tiago_pro_description; drives from each joint's inertia",
    allowed_collisions=among(
        (*BASE, "torso_lift_link", "torso_head_link", "arm_left_1_link", "arm_right_1_link"),
        *((*BASE, f"{wheel}_link") for wheel in WHEELS),
        *((f"arm_{side}_7_link", f"gripper_{side}_base_link",
           *(f"gripper_{side}_{part}_{finger}_link" for finger in SIDES
             for part in ("inner_finger", "outer_finger", "fingertip"))) for side in SIDES),
        *((f"arm_{side}_6_link", f"gripper_{side}_base_link") for side in SIDES),
        ("head_1_link", "head_front_camera_link", "torso_lift_link")))
