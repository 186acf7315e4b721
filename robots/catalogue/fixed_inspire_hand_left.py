"""Inspire RH56DFX left hand on its wrist, five fingers: 2 + 6 action numbers."""

from robots.catalogue.fixed_inspire_hand_right import hand

FIXED_INSPIRE_HAND_LEFT = hand("left")
