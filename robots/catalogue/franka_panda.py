"""Franka Emika Panda with its hand, from files under the Apache licence: 7 + 1 numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.panda import PANDA
from robots.parts import among

FRANKA_PANDA = replace(
    PANDA,
    name="franka_panda",
    urdf=UrdfLocator("example_panda_description", "urdf/panda.urdf"),
    source="example-robot-data 6.0.0, panda_description; drives of mani_skill 3.0.1's panda.py",
    allowed_collisions=among(  # neighbours, and what overlaps however the joints stand
        ("panda_link5", "panda_link6", "panda_link7"),
        ("panda_link6", "panda_link7", "panda_hand"),
        ("panda_link7", "panda_hand", "panda_leftfinger"),
        ("panda_link7", "panda_hand", "panda_rightfinger"),
    ),
)
