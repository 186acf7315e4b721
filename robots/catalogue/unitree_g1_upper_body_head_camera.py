"""Unitree G1 on legs that stand still, with a camera in its head: 25 action numbers."""

from dataclasses import replace
from math import cos, pi, sin

from robots.catalogue.unitree_g1_upper_body import UNITREE_G1_UPPER_BODY
from robots.descriptor import CameraMount

DOWN = (cos(pi / 12), 0.0, sin(pi / 12), 0.0)  # looks 30 degrees down

UNITREE_G1_UPPER_BODY_HEAD_CAMERA = replace(
    UNITREE_G1_UPPER_BODY,
    name="unitree_g1_upper_body_head_camera",
    cameras=(CameraMount("head_camera", "head_link", position=(0.05, 0.0, 0.46), quaternion=DOWN),),
)
