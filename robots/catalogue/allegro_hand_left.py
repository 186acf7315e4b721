"""Wonik Allegro left hand, four fingers of four joints: 16 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.allegro_hand_right import ALLEGRO_HAND_RIGHT

ALLEGRO_HAND_LEFT = replace(
    ALLEGRO_HAND_RIGHT,
    name="allegro_hand_left",
    urdf=UrdfLocator("maniskill_allegro", "allegro_hand_left.urdf"),
)
