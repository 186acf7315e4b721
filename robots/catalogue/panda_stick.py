"""Panda with a fixed stick in place of its hand: 7 action numbers, arm only."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.panda import ARM, PANDA
from robots.descriptor import ActionSplit

PANDA_STICK = replace(
    PANDA,
    name="panda_stick",
    urdf=UrdfLocator("maniskill_panda", "panda_stick.urdf"),
    action_split=ActionSplit(arm=ARM),
    gripper_material=None,
    fingers=None,
    keyframes={
        "rest": PANDA.keyframe("rest")[:7],
        # Stick over the marker where PushT starts (native: envs/tasks/tabletop/push_t.py).
        "push_start": (0.662, 0.212, 0.086, -2.685, -0.115, 2.898, 1.673),
    },
    source="mani_skill 3.0.1, agents/robots/panda/panda_stick.py and tasks/tabletop/push_t.py",
)
