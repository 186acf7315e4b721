"""PSYONIC Ability Hand, left, that flies without an arm: 3 + 3 + 4 + 2 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.floating_ability_hand_right import FLOATING_ABILITY_HAND_RIGHT

FLOATING_ABILITY_HAND_LEFT = replace(
    FLOATING_ABILITY_HAND_RIGHT,
    name="floating_ability_hand_left",
    urdf=UrdfLocator("maniskill_ability_hand", "ability_hand_left_floating.urdf"),
)
