"""UFACTORY xArm 7 without a hand: 7 action numbers."""

from dataclasses import replace
from math import pi

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, Home, JointGroup, RobotDescriptor, names

FULL_TURNS = (-2 * pi, 2 * pi)

ARM = JointGroup(
    names("joint", 1, 7),
    lower=-0.1,
    upper=0.1,
    delta=True,
    stiffness=1e3,
    damping=1e2,
    force_limit=500.0,
    limits=(
        FULL_TURNS,
        (-2.059, 2.0944),
        FULL_TURNS,
        (-0.19198, 3.927),
        FULL_TURNS,
        (-1.69297, pi),
        FULL_TURNS,
    ),
)

XARM7 = RobotDescriptor(
    name="xarm7",
    urdf=UrdfLocator("maniskill_xarm7", "xarm7.urdf"),
    action_split=ActionSplit(arm=replace(ARM, approximate_ik=True)),
    tcp_link="link_eef",
    keyframes={"rest": (0.0, -0.4, 0.0, 0.5, 0.0, 0.9, -3.0)},
    home=Home(position=(-0.522, 0.0, 0.0)),  # where scene_builder/table stands an xArm 6
    reach=0.77,  # of the TCP, from the URDF
    source="mani_skill 3.0.1, agents/robots/xarm/xarm7_ability.py, its arm alone",
)
