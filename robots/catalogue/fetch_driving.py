"""Fetch whose base drives, too: 7 + 1 numbers, 3 for its head and torso, 2 for its base."""

from dataclasses import replace

from robots.catalogue.fetch import FETCH, SLIDE
from robots.descriptor import ActionSplit, JointGroup

GROUPS = FETCH.action_split.groups
BASE = JointGroup(
    (*SLIDE.joints, *GROUPS["base_turn"].joints),
    command="base_velocity",
    lower=(-1.0, -3.14),  # m/s, rad/s
    upper=(1.0, 3.14),
    stiffness=0.0,
    damping=1e3,
    force_limit=500.0,
    unit="m",
    reset_noise=False,
)

FETCH_DRIVING = replace(
    FETCH,
    name="fetch_driving",
    action_split=ActionSplit(
        arm=GROUPS["arm"],
        gripper=GROUPS["gripper"],
        head=GROUPS["head"],
        torso=GROUPS["torso"],
        base=BASE,
    ),
    source="mani_skill 3.0.1, agents/robots/fetch/fetch.py",
)
