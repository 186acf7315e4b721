"""Universal Robots UR3 with a gripper that does not move: 6 action numbers."""

from dataclasses import replace
from math import pi

from robots.assets.locator import UrdfLocator
from robots.catalogue.ur3 import UR3

ARM = replace(UR3.action_split.groups["arm"], limits=((-pi, pi),) * 6)

UR3_GRIPPER = replace(
    UR3,
    name="ur3_gripper",
    urdf=UrdfLocator("example_ur_description", "urdf/ur3_gripper.urdf"),
    action_split=UR3.action_split.replace(arm=ARM),
)
