"""Panda whose hand has two long fingers for pinching: 7 + 1 action numbers. Cannot be drawn."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.panda import PANDA

GRIPPER = replace(
    PANDA.action_split.groups["gripper"], upper=0.06, limits=((0.0, 0.06), (0.0, 0.06))
)

PANDA_PINCH = replace(
    PANDA,
    name="panda_pinch",
    urdf=UrdfLocator("maniskill_panda", "panda_pinch.urdf"),
    action_split=PANDA.action_split.replace(gripper=GRIPPER),
    keyframes={"rest": (*PANDA.keyframe("rest")[:7], 0.06, 0.06)},
    reach=1.0,  # of the TCP, from the URDF: the hand is longer
    source="mani_skill 3.0.1, agents/robots/panda/panda.py; fingers from panda_pinch.urdf",
)
