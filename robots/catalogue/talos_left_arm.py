"""Left arm of PAL Robotics' Talos with its gripper: 6 + 1 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.talos import LEFT_ARM, LEFT_GRIPPER, LEFT_HAND, LEFT_WRIST, TALOS
from robots.descriptor import ActionSplit, GripperMaterial
from robots.parts import among

ARM = replace(  # without the shoulder's first joint, which its URDF lacks
    LEFT_ARM,
    joints=LEFT_ARM.joints[1:],
    lower=(-0.04, -0.04, -0.04, -0.065, -0.1, -0.1),
    upper=(0.04, 0.04, 0.04, 0.065, 0.1, 0.1),
    stiffness=(3.06e4, 8230.0, 7430.0, 1000.0, 1000.0, 1000.0),
    damping=(409.0, 110.0, 99.0, 10.5, 10.3, 10.2),
    force_limit=(87.2, 23.4, 21.1, 3.0, 6.6, 6.6),
    limits=LEFT_ARM.limits[1:],
)

TALOS_LEFT_ARM = replace(
    TALOS,
    name="talos_left_arm",
    urdf=UrdfLocator("example_talos_data", "robots/talos_left_arm.urdf"),
    action_split=ActionSplit(arm=ARM, gripper=LEFT_GRIPPER),
    gripper_material=GripperMaterial(LEFT_HAND, 2.0, 2.0, 0.0, patch_radius=0.1),
    keyframes={"rest": (1.45, 0.6, -1.07, -1.59, 0.9, 0.0, 0.0)},
    reach=0.898,  # of the TCP, from the URDF
    allowed_collisions=among((*LEFT_WRIST, *LEFT_HAND)),
    limbs={},
)
