"""Universal Robots UR5 with a gripper that does not move: 6 action numbers."""

from dataclasses import replace
from math import pi

from robots.assets.locator import UrdfLocator
from robots.catalogue.ur5 import UR5

ARM = replace(UR5.action_split.groups["arm"], limits=((-pi, pi),) * 6)

UR5_GRIPPER = replace(
    UR5,
    name="ur5_gripper",
    urdf=UrdfLocator("example_ur_description", "urdf/ur5_gripper.urdf"),
    action_split=UR5.action_split.replace(arm=ARM),
)
