"""Inspire RH56DFX left hand that flies without an arm: 3 + 3 + 2 + 6 action numbers."""

from robots.catalogue.floating_inspire_hand_right import flying

FLOATING_INSPIRE_HAND_LEFT = flying("left")
