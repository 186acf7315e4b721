"""PSYONIC Ability Hand, left, five fingers: 4 + 2 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.ability_hand_right import ABILITY_HAND_RIGHT

ABILITY_HAND_LEFT = replace(
    ABILITY_HAND_RIGHT,
    name="ability_hand_left",
    urdf=UrdfLocator("maniskill_ability_hand", "ability_hand_left.urdf"),
)
