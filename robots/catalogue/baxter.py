"""Rethink Robotics Baxter, two arms with grippers: 2 × (7 + 1) action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, Fingers, GripperMaterial, JointGroup, RobotDescriptor
from robots.link_pairs import among
from robots.parts import both_sides

# fmt: off
SIDES = ("left", "right")
FINGERS = tuple(f"{s}_gripper_{f}_finger_tip" for s in "lr" for f in "lr")
BODY = ("torso", "sonar_ring", "pedestal", "collision_head_link_1", "collision_head_link_2")
LEFT_ARM = JointGroup(
    tuple(f"left_{joint}" for joint in ("s0", "s1", "e0", "e1", "w0", "w1", "w2")),
    lower=(-0.04, -0.04, -0.04, -0.04, -0.09, -0.1, -0.1),
    upper=(0.04, 0.04, 0.04, 0.04, 0.09, 0.1, 0.1),
    stiffness=(9.83e4, 7.87e4, 2.45e4, 1.83e4, 2320.0, 2080.0, 1000.0),
    damping=(1310.0, 1050.0, 327.0, 245.0, 31.0, 27.8, 12.7),
    force_limit=(280.0, 224.0, 69.7, 52.2, 15.0, 15.0, 15.0), delta=True,
    limits=((-1.70168, 1.70168), (-2.147, 1.047), (-3.05418, 3.05418), (-0.05, 2.618),
            (-3.059, 3.059), (-1.5707964, 2.094), (-3.059, 3.059)),
)
LEFT_GRIPPER = JointGroup(
    ("l_gripper_l_finger_joint", "l_gripper_r_finger_joint"), lower=-0.01, upper=0.020833,
    stiffness=1e3, damping=1e2, force_limit=20.0, mimic=True, multipliers=(1.0, -1.0),
    unit="m", reset_noise=False, limits=((0.0, 0.020833), (-0.020833, 0.0)),
)
REST = (-0.55, 0.0, 0.75, 0.0, 1.26, 0.0, 0.020833, -0.020833)  # "neutral", arms turned in

BAXTER = RobotDescriptor(
    name="baxter",
    urdf=UrdfLocator("example_baxter_description", "urdf/baxter.urdf"),
    action_split=ActionSplit(
        left_arm=LEFT_ARM, left_gripper=LEFT_GRIPPER,
        right_arm=replace(LEFT_ARM, joints=tuple(f"right{j[4:]}" for j in LEFT_ARM.joints)),
        right_gripper=replace(LEFT_GRIPPER, joints=tuple(f"r{j[1:]}" for j in LEFT_GRIPPER.joints)),
        head=JointGroup.hold(("head_pan",)),
    ),
    tcp_link="left_gripper", fingers=Fingers((FINGERS[0], FINGERS[1])),
    gripper_material=GripperMaterial((*FINGERS, *(f[:-4] for f in FINGERS)), 2.0, 2.0, 0.0, 0.1),
    limbs=both_sides("{side}_gripper", 1.201, (0.064, 0.259, 0.1296),
                     Fingers(("{s}_gripper_l_finger_tip", "{s}_gripper_r_finger_tip"))),
    keyframes={"rest": (-0.3, *REST, 0.3, *REST, 0.0)},
    reach=1.468,  # of the left TCP, from the URDF; data sheet 1.21 from the shoulder
    source="example-robot-data 6.0.0, baxter_description; drives from each joint's inertia",
    allowed_collisions=among(
        (*BODY, "head", "screen"),
        *((*BODY, f"{side}_upper_shoulder", f"{side}_lower_shoulder") for side in SIDES),
        *(tuple(f"{side}_{part}" for part in parts) for side in SIDES for parts in (
            ("upper_shoulder", "lower_shoulder", "upper_elbow_visual", "upper_elbow",
             "lower_elbow"),
            ("upper_elbow", "lower_elbow", "upper_forearm", "upper_forearm_visual",
             "lower_forearm", "wrist"),
            ("lower_forearm", "wrist", "hand_link", "gripper_base_link"))),
        *((f"{side}_wrist", f"{side}_hand_link", f"{side}_gripper_base_link", f[:-4], f)
          for side in SIDES for f in FINGERS if f[0] == side[0]),
        *(tuple(f[:-4] for f in pair) for pair in (FINGERS[:2], FINGERS[2:])),
    ),
)
