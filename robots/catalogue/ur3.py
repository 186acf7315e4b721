"""Universal Robots UR3 without a hand: 6 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.ur5 import ARM, UR5
from robots.descriptor import ActionSplit

UR3_ARM = replace(
    ARM,
    lower=-0.1,
    upper=0.1,
    stiffness=(1.61e4, 1.51e4, 2920.0, 1000.0, 1000.0, 1000.0),
    damping=(215.0, 201.0, 38.9, 5.54, 3.6, 1.91),
    force_limit=(56.0, 56.0, 28.0, 12.0, 12.0, 12.0),  # data sheet; the URDF has a UR10's
)

UR3 = replace(
    UR5,
    name="ur3",
    urdf=UrdfLocator("example_ur_description", "urdf/ur3_robot.urdf"),
    action_split=ActionSplit(arm=UR3_ARM),
    reach=0.589,  # of the TCP, from the URDF; data sheet 0.5, to the wrist
)
