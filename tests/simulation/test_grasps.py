"""Grasps by contact forces: along the axes in which the fingers open."""

from __future__ import annotations

import numpy as np
import pytest

from robot_layouts.simulation.grasps import grasped
from robots import Fingers

AS_IT_IS, ROLLED = (1.0, 0.0, 0.0, 0.0), (0.5**0.5, 0.5**0.5, 0.0, 0.0)  # by 90 degrees about x


@pytest.mark.parametrize(
    ("axis", "turned", "way"),
    [
        ((0.0, 1.0, 0.0), AS_IT_IS, (0.0, 1.0, 0.0)),
        ((0.0, 0.0, 1.0), AS_IT_IS, (0.0, 0.0, 1.0)),
        ((0.0, 0.0, 2.0), ROLLED, (0.0, -1.0, 0.0)),
        ((0.0, 0.6, 0.8), AS_IT_IS, (0.0, 0.6, 0.8)),
    ],
)
def test_fingers_hold_what_presses_along_their_axes(axis, turned, way):
    fingers = Fingers(("one", "other"), max_angle=5.0, opening_axes=(axis, axis))
    press = np.array([way, (1.0, 0.0, 0.0)], np.float32)  # right in one world, wrong in the other
    poses = [np.array([(0, 0, 0, *turned)] * 2, np.float32)] * 2
    assert grasped(fingers, np.array([press, -press]), poses).tolist() == [True, False]
