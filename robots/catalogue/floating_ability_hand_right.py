"""PSYONIC Ability Hand, right, that flies without an arm: 3 + 3 + 4 + 2 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.ability_hand_right import ABILITY_HAND_RIGHT, FINGERS, THUMB
from robots.catalogue.floating_panda_gripper import POSITION, ROTATION
from robots.descriptor import ActionSplit

FLOATING_ABILITY_HAND_RIGHT = replace(
    ABILITY_HAND_RIGHT,
    name="floating_ability_hand_right",
    urdf=UrdfLocator("maniskill_ability_hand", "ability_hand_right_floating.urdf"),
    action_split=ActionSplit(position=POSITION, rotation=ROTATION, **FINGERS, thumb=THUMB),
    keyframes={"rest": (*(0,) * 6, *ABILITY_HAND_RIGHT.keyframe("rest"))},
    reach=1.0,  # a working size: its joints end at 20 m
)
