"""Inspire RH56DFX right hand that flies without an arm: 3 + 3 + 2 + 6 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.fixed_inspire_hand_right import hand
from robots.catalogue.floating_panda_gripper import POSITION, ROTATION
from robots.descriptor import ActionSplit, RobotDescriptor


def flying(side: str) -> RobotDescriptor:
    """Return a hand that flies; it is ``left`` or ``right``."""
    fixed = hand(side)
    urdf = f"RH56DFX-2LR/urdf/inspire_hand_{side}_floating.urdf"
    groups = fixed.action_split.groups
    return replace(
        fixed,
        name=f"floating_inspire_hand_{side}",
        urdf=UrdfLocator("maniskill_inspire_hand", urdf),
        action_split=ActionSplit(position=POSITION, rotation=ROTATION, **groups),
        keyframes={"rest": (*(0,) * 6, *fixed.keyframe("rest"))},
        reach=1.0,  # a working size: its joints end at 20 m
        source="mani_skill 3.0.1, agents/robots/inspire_hand/floating_inspire_hand.py",
    )


FLOATING_INSPIRE_HAND_RIGHT = flying("right")
