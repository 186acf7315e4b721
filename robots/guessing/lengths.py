"""How long the chains of a robot are, by the places of its joints with all of them at 0."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from robots.urdf.model import ModelJoint, UrdfModel
from robots.urdf.tree import kinematic_tree

if TYPE_CHECKING:
    from collections.abc import Sequence

    from kinematics.rotations import Floats


class Lengths:
    """Distances along the joints of a robot (m); turning joints do not change them."""

    def __init__(self, model: UrdfModel) -> None:
        """Place every link of a robot whose joints are all at 0."""
        self._model = model
        tree = kinematic_tree(model)
        poses = tree.forward(np.zeros((1, len(tree.coordinates))))[0]
        self._places = dict(zip(tree.links, poses[:, :3, 3], strict=True))

    def place(self, joint: ModelJoint) -> Floats:
        """Return where a joint is, in the root's frame, (3,) (m)."""
        return self._places[joint.child]

    def between(self, link: str, joint: ModelJoint) -> float:
        """Return the length from a link over a joint on it to the end of the chain (m)."""
        way = np.linalg.norm(self._places[joint.child] - self._places[link])
        return float(way) + self.behind(joint)

    def along(self, joints: Sequence[ModelJoint]) -> float:
        """Return the length of joints in a row, from the first to the last (m)."""
        places = [self.place(joint) for joint in joints]
        return float(sum(np.linalg.norm(b - a) for a, b in zip(places, places[1:], strict=False)))

    def behind(self, joint: ModelJoint) -> float:
        """Return the length from a joint to the end of the longest chain that it moves (m)."""
        return self._behind[joint.name]

    @cached_property
    def _behind(self) -> dict[str, float]:
        lengths: dict[str, float] = dict.fromkeys(self._model.links, 0.0)
        for joint in reversed(self._model.ordered):
            way = np.linalg.norm(self._places[joint.child] - self._places[joint.parent])
            lengths[joint.parent] = max(lengths[joint.parent], float(way) + lengths[joint.child])
        return {joint.name: lengths[joint.child] for joint in self._model.joints}
