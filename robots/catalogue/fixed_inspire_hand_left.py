"""Inspire RH56DFX left hand on its wrist, five fingers: 2 + 6 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.fixed_inspire_hand_right import FIXED_INSPIRE_HAND_RIGHT, GRIPPING, LINKS
from robots.descriptor import ActionSplit, GripperMaterial
from robots.parts import among, mirrored

GROUPS = FIXED_INSPIRE_HAND_RIGHT.action_split.groups

FIXED_INSPIRE_HAND_LEFT = replace(
    FIXED_INSPIRE_HAND_RIGHT,
    name="fixed_inspire_hand_left",
    urdf=UrdfLocator("maniskill_inspire_hand", "RH56DFX-2LR/urdf/inspire_hand_left.urdf"),
    action_split=ActionSplit(
        wrist=replace(GROUPS["wrist"], joints=mirrored(GROUPS["wrist"].joints)),
        thumb_turn=replace(GROUPS["thumb_turn"], joints=mirrored(GROUPS["thumb_turn"].joints)),
        thumb=replace(GROUPS["thumb"], joints=mirrored(GROUPS["thumb"].joints)),
        index=replace(GROUPS["index"], joints=mirrored(GROUPS["index"].joints)),
        middle=replace(GROUPS["middle"], joints=mirrored(GROUPS["middle"].joints)),
        ring=replace(GROUPS["ring"], joints=mirrored(GROUPS["ring"].joints)),
        pinky=replace(GROUPS["pinky"], joints=mirrored(GROUPS["pinky"].joints)),
    ),
    tcp_link="left_hand_thumb_tip",
    tcp_position_links=("left_hand_thumb_tip", "left_hand_index_tip"),
    gripper_material=GripperMaterial(mirrored(GRIPPING), 2.0, 2.0, 0.0, patch_radius=0.1),
    allowed_collisions=among(mirrored(LINKS)),  # as ManiSkill, which lets the hand overlap
)
