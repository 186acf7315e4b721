"""A cell: all robots of a layout, what stands around them and what they hold."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from kinematics.rotations import inverse_pose
from motion.bodies import Bodies
from motion.collisions import Checker
from motion.obstacles import Held, Obstacle
from robots import LayoutError, UnknownNameError
from robots.common.bounds import checked_number

LARGEST_CLEARANCE = 1.0  # m


class Cell(Bodies):
    """All robots of a layout, and the bodies around them; what checks of collisions begin with."""

    def checker(
        self,
        moving: Iterable[str] | None = None,
        clearance: float = 0.0,
        except_: Iterable[tuple[str, str]] = (),
    ) -> Checker:
        """Return what tells whether robots touch each other or anything else.

        Pairs that count: those of each robot's own links that a layout's check looks at; links of
        different robots; links and what is held with tables and obstacles. A table does not count
        against what never moves, such as the base that stands on it, nor does an obstacle that
        does not move either.

        Args:
            moving: The robots that move; only pairs in which one of them, or what it holds, takes
                part are looked at. None is all of them.
            clearance: How near bodies may come (m).
            except_: Pairs that may touch; each a pair of names of `names`.

        Raises:
            LayoutError: If the clearance makes no sense.
            UnknownNameError: If there is no such robot or body.
        """
        clearance = checked_number("clearance", clearance, 0.0, LARGEST_CLEARANCE, LayoutError, "m")
        movers = {self.layout.owner(name) for name in (self.robots if moving is None else moving)}
        excepted = [tuple(self._named(name) for name in pair) for pair in except_]
        pairs = [
            pair
            for pair in self.counted_pairs
            if not movers.isdisjoint(self.solids[i].mover for i in pair)
            and not any(self._is(pair, names) for names in excepted)
        ]
        return Checker(self, np.array(pairs, np.intp).reshape(-1, 2), clearance)

    def grasped(self, place: str, obstacle: Obstacle, qpos: ArrayLike | None = None) -> Held:
        """Return a body as it is held by an arm that grasps it where it is.

        Args:
            place: The arm: a robot, or a limb.
            obstacle: The body, at its pose in the world.
            qpos: The coordinates there, (D,) (rad, m); None is the cell's start.

        Raises:
            LayoutError: If the body moves by itself.
            UnknownNameError: If there is no such arm.
        """
        robot, link = self.tcp(place)
        poses = self.poses(np.atleast_2d(self.start if qpos is None else np.asarray(qpos, float)))
        tcp = poses[0, self.links.index((robot, self.models[robot].kinematics.links[link]))]
        if obstacle.moves:
            return Held(place, obstacle)  # says what is wrong
        return Held(place, obstacle.moved(inverse_pose(tcp) @ obstacle.poses(None, 1)[0]))

    def _named(self, name: str) -> str:
        if name not in self.names:
            raise UnknownNameError("body of this cell", name, self.names)
        return name

    def _is(self, pair: Sequence[int], names: Sequence[str]) -> bool:
        """Whether two solids are those that two names stand for."""
        one, other = ({self.solids[i].owner, self.solids[i].name} for i in pair)
        first, second = names
        return (first in one and second in other) or (second in one and first in other)
