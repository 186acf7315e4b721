"""Unitree G1 of which the right arm alone is driven: 4 + 7 action numbers."""

from dataclasses import replace

from robots.catalogue.unitree_g1_upper_body import UNITREE_G1_UPPER_BODY
from robots.descriptor import ActionSplit, JointGroup

GROUPS = UNITREE_G1_UPPER_BODY.action_split.groups
PITCH, *ARM = GROUPS["right_arm"].joints
OTHERS = (*GROUPS["left_arm"].joints, *GROUPS["left_gripper"].joints, PITCH, "torso_joint")

UNITREE_G1_UPPER_BODY_RIGHT_ARM = replace(
    UNITREE_G1_UPPER_BODY,
    name="unitree_g1_upper_body_right_arm",
    action_split=ActionSplit(
        # ManiSkill leaves the shoulder's first joint out, too.
        right_arm=replace(GROUPS["right_arm"], joints=ARM, limits=GROUPS["right_arm"].limits[1:]),
        right_gripper=replace(GROUPS["right_gripper"], lower=-0.2, upper=0.2),
        others=JointGroup.hold(OTHERS, stiffness=0.0, damping=1e2, force_limit=1e10),
    ),
    tcp_link="right_tcp_link",
    limbs={},
)
