"""UFACTORY xArm 7 with a PSYONIC Ability Hand, right: 7 + 4 + 2 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.ability_hand_right import ABILITY_HAND_RIGHT, FINGERS, THUMB
from robots.catalogue.xarm7 import ARM, XARM7
from robots.descriptor import ActionSplit

XARM7_ABILITY = replace(
    XARM7,
    name="xarm7_ability",
    urdf=UrdfLocator("maniskill_robots", "xarm7/xarm7_ability_right_hand.urdf"),
    action_split=ActionSplit(arm=ARM, **FINGERS, thumb=THUMB),
    tcp_link="base",
    gripper_material=ABILITY_HAND_RIGHT.gripper_material,
    keyframes={"rest": (*XARM7.keyframe("rest"), *ABILITY_HAND_RIGHT.keyframe("rest"))},
    source="mani_skill 3.0.1, agents/robots/xarm/xarm7_ability.py",
)
