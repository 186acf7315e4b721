"""Unitree G1 on legs that stand still, driven as ManiSkill does: 25 numbers of one group."""

from dataclasses import replace

from robots.catalogue.unitree_g1_upper_body_head_camera import UNITREE_G1_UPPER_BODY_HEAD_CAMERA
from robots.descriptor import ActionSplit, JointGroup

PITCH, YAW, ELBOW, ROLL = (-2.9671, 2.7925), (-2.618, 2.618), (-0.2268, 3.4208), (-2.0943, 2.0943)
TURN, BEND, TIP = (-0.523598, 0.523598), (-1.84, 0.3), (-1.84, 0.0)
OTHER_BEND, OTHER_TIP = (-0.3, 1.84), (-0.0, 1.84)

BODY = JointGroup(
    (
        "torso_joint",
        "left_shoulder_pitch_joint",
        "right_shoulder_pitch_joint",
        "left_shoulder_roll_joint",
        "right_shoulder_roll_joint",
        "left_shoulder_yaw_joint",
        "right_shoulder_yaw_joint",
        "left_elbow_pitch_joint",
        "right_elbow_pitch_joint",
        "left_elbow_roll_joint",
        "right_elbow_roll_joint",
        "left_zero_joint",
        "left_three_joint",
        "left_five_joint",
        "right_zero_joint",
        "right_three_joint",
        "right_five_joint",
        "left_one_joint",
        "left_four_joint",
        "left_six_joint",
        "right_one_joint",
        "right_four_joint",
        "right_six_joint",
        "left_two_joint",
        "right_two_joint",
    ),
    lower=(-0.2,) * 11 + (-0.5,) * 14,
    upper=(0.2,) * 11 + (0.5,) * 14,
    delta=True,
    stiffness=1e3,
    damping=1e2,
    force_limit=100.0,
    limits=(
        YAW,
        *(PITCH, PITCH),
        *((-1.5882, 2.2515), (-2.2515, 1.5882)),
        *(YAW, YAW, ELBOW, ELBOW, ROLL, ROLL),
        *(TURN, BEND, BEND),
        *(TURN, OTHER_BEND, OTHER_BEND),
        *((-1.0, 1.2), TIP, TIP),
        *((-1.2, 1.0), OTHER_TIP, OTHER_TIP),
        *((0.0, 1.84), (-1.84, -0.0)),
    ),
)

UNITREE_G1_SIMPLIFIED_UPPER_BODY_WITH_HEAD_CAMERA = replace(
    UNITREE_G1_UPPER_BODY_HEAD_CAMERA,
    name="unitree_g1_simplified_upper_body_with_head_camera",
    action_split=ActionSplit(body=BODY),
    limbs={},
)
