"""Inspire RH56DFX left hand on its wrist, five fingers: 2 + 6 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.fixed_inspire_hand_right import FIXED_INSPIRE_HAND_RIGHT
from robots.descriptor import ActionSplit, GripperMaterial
from robots.parts import among

GROUPS = FIXED_INSPIRE_HAND_RIGHT.action_split.groups
# From the palm on: what grips.
GRIPPING = (
    "left_hand_hand_base_link",
    "left_hand_thumb_metacarpal",
    "left_hand_thumb_proximal",
    "left_hand_thumb_distal",
    "left_hand_index_proximal",
    "left_hand_index_middle",
    "left_hand_middle_proximal",
    "left_hand_middle_middle",
    "left_hand_ring_proximal",
    "left_hand_ring_middle",
    "left_hand_pinky_proximal",
    "left_hand_pinky_middle",
)

FIXED_INSPIRE_HAND_LEFT = replace(
    FIXED_INSPIRE_HAND_RIGHT,
    name="fixed_inspire_hand_left",
    urdf=UrdfLocator("maniskill_inspire_hand", "RH56DFX-2LR/urdf/inspire_hand_left.urdf"),
    action_split=ActionSplit(
        wrist=replace(
            GROUPS["wrist"], joints=("left_hand_wrist_pitch_joint", "left_hand_wrist_yaw_joint")
        ),
        thumb_turn=replace(GROUPS["thumb_turn"], joints=("left_hand_thumb_CMC_yaw_joint",)),
        thumb=replace(
            GROUPS["thumb"],
            joints=(
                "left_hand_thumb_CMC_pitch_joint",
                "left_hand_thumb_MCP_joint",
                "left_hand_thumb_IP_joint",
            ),
        ),
        index=replace(
            GROUPS["index"], joints=("left_hand_index_MCP_joint", "left_hand_index_PIP_joint")
        ),
        middle=replace(
            GROUPS["middle"], joints=("left_hand_middle_MCP_joint", "left_hand_middle_PIP_joint")
        ),
        ring=replace(
            GROUPS["ring"], joints=("left_hand_ring_MCP_joint", "left_hand_ring_PIP_joint")
        ),
        pinky=replace(
            GROUPS["pinky"], joints=("left_hand_pinky_MCP_joint", "left_hand_pinky_PIP_joint")
        ),
    ),
    tcp_link="left_hand_thumb_tip",
    tcp_position_links=("left_hand_thumb_tip", "left_hand_index_tip"),
    gripper_material=GripperMaterial(GRIPPING, 2.0, 2.0, 0.0, patch_radius=0.1),
    allowed_collisions=among(  # as ManiSkill, which lets the hand overlap
        (
            "left_hand_wrist_base_link",
            "left_hand_wrist_link",
            "left_hand_hand_base_link",
            "left_hand_thumb_metacarpal_base",
            "left_hand_thumb_metacarpal",
            "left_hand_thumb_proximal",
            "left_hand_thumb_distal",
            "left_hand_index_proximal",
            "left_hand_index_middle",
            "left_hand_middle_proximal",
            "left_hand_middle_middle",
            "left_hand_ring_proximal",
            "left_hand_ring_middle",
            "left_hand_pinky_proximal",
            "left_hand_pinky_middle",
        )
    ),
)
