"""Universal Robots UR10 without a hand: 6 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.ur5 import ARM, UR5
from robots.descriptor import ActionSplit

UR10_ARM = replace(
    ARM,
    lower=(-0.04, -0.04, -0.05, -0.1, -0.1, -0.1),
    upper=(0.04, 0.04, 0.05, 0.1, 0.1, 0.1),
    stiffness=(2.56e5, 2.41e5, 4.09e4, 1000.0, 1000.0, 1000.0),
    damping=(3420.0, 3210.0, 545.0, 7.34, 4.93, 1.45),
    force_limit=(729.0, 685.0, 150.0, 54.0, 54.0, 54.0),  # data sheet 330, 330, 150, 54, 54, 54
)

UR10 = replace(
    UR5,
    name="ur10",
    urdf=UrdfLocator("example_ur_description", "urdf/ur10_robot.urdf"),
    action_split=ActionSplit(arm=UR10_ARM),
    reach=1.343,  # of the TCP, from the URDF; data sheet 1.3, to the wrist
)
