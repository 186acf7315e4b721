"""Inspire RH56DFX left hand that flies without an arm: 3 + 3 + 2 + 6 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.fixed_inspire_hand_left import FIXED_INSPIRE_HAND_LEFT
from robots.catalogue.floating_panda_gripper import POSITION, ROTATION
from robots.descriptor import ActionSplit

GROUPS = FIXED_INSPIRE_HAND_LEFT.action_split.groups

FLOATING_INSPIRE_HAND_LEFT = replace(
    FIXED_INSPIRE_HAND_LEFT,
    name="floating_inspire_hand_left",
    urdf=UrdfLocator("maniskill_inspire_hand", "RH56DFX-2LR/urdf/inspire_hand_left_floating.urdf"),
    action_split=ActionSplit(position=POSITION, rotation=ROTATION, **GROUPS),
    keyframes={"rest": (*(0,) * 6, *FIXED_INSPIRE_HAND_LEFT.keyframe("rest"))},
    reach=1.0,  # a working size: its joints end at 20 m
    source="mani_skill 3.0.1, agents/robots/inspire_hand/floating_inspire_hand.py",
)
