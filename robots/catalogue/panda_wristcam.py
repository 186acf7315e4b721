"""Panda with a RealSense camera on its hand: 7 + 1 action numbers."""

from dataclasses import replace
from math import pi

from robots.assets.locator import UrdfLocator
from robots.catalogue.panda import PANDA
from robots.descriptor import CameraMount

PANDA_WRISTCAM = replace(
    PANDA,
    name="panda_wristcam",
    urdf=UrdfLocator("maniskill_panda", "panda_v3.urdf"),
    cameras=(CameraMount("hand_camera", link="camera_link"),),
    keyframes={
        **PANDA.keyframes,
        # The hand turned by half a turn, so that the camera sees the table's far side.
        "tabletop": (0, pi / 8, 0, -5 * pi / 8, 0, 3 * pi / 4, -pi / 4, 0.04, 0.04),
    },
    home=replace(PANDA.home, keyframe="tabletop"),
    source="mani_skill 3.0.1, agents/robots/panda/panda_wristcam.py and scene_builder/table",
)
