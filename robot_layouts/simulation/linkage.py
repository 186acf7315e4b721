"""How a joint group with leaders is driven; see `robots.JointGroup`.

Each joint's own target would let those that nothing stops go on alone, so that jaws which hold
something splay. So before each step of physics leaders are driven at most their lead ahead of their
mean place, which bounds the force, and the others to where the leaders are and as fast.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from robots import JointGroup


class Leaders:
    """The leaders of a joint group, as one joint of which all others' places follow.

    Attributes:
        places: Where they stand among the group's joints.
    """

    def __init__(self, group: JointGroup) -> None:
        """Take a group that has some."""
        self.places = [group.joints.index(name) for name in group.leaders]
        followers = [group.followers[place] for place in self.places]
        self._multipliers, self._offsets = np.array(followers, float).T
        self._lead = group.lead

    def moved(
        self, wanted: float, qpos: NDArray[np.floating], qvel: NDArray[np.floating]
    ) -> tuple[float, float, float]:
        """Return where they are to go next, where they are, and how fast, as that one joint.

        Args:
            wanted: Where it is to be in the end.
            qpos: Positions of the leaders (rad, m).
            qvel: Their velocities.
        """
        value = float(((qpos - self._offsets) / self._multipliers).mean())
        speed = float((qvel / self._multipliers).mean())
        return min(max(wanted, value - self._lead), value + self._lead), value, speed
