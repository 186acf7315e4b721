"""What robots feel: the contact forces on links that a scenario names, as parts of observations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.core.bounds import shown
from robot_layouts.simulation import State
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.rotations import rotation_matrix
from robots import TaskError, UnknownNameError

TOUCH = "touch"  # between the arm and the link in the names of what is felt


def touch_links(layout: Layout, declared: Any) -> dict[str, tuple[str, ...]]:
    """Return the links that feel, by arm.

    Args:
        layout: The robots.
        declared: See `tasks.Scenario.touch`.

    Raises:
        UnknownNameError: If it names an arm that does not exist.
        TaskError: If it is invalid, or an arm whose fingers are to feel has none.
    """
    if not declared:
        return {}
    if declared is True:
        declared = {arm: True for arm, place in layout.arms.items() if place.robot.fingers}
        if not declared:
            raise TaskError(
                "touch is True, but no robot has known fingers; name links, such as"
                f" touch={{{next(iter(layout))!r}: ('palm', 'thumb_tip')}}"
            )
    if not isinstance(declared, Mapping):
        raise TaskError(f"touch is {shown(declared)}; True, or links by arm are needed")
    return {arm: _links(layout, arm, links) for arm, links in declared.items()}


def _links(layout: Layout, arm: str, links: Any) -> tuple[str, ...]:
    known = {**layout, **layout.arms}
    if arm not in known:
        raise UnknownNameError("arm for touch", arm, known)
    if links is True:
        if (fingers := known[arm].robot.fingers) is None:
            raise TaskError(f"touch of {arm!r} is True, but its fingers are not known; name links")
        return fingers.links
    named = isinstance(links, Sequence) and not isinstance(links, str) and bool(links)
    if not named or not all(isinstance(link, str) for link in links):
        raise TaskError(f"touch of {arm!r} is {shown(links)}; True, or names of links are needed")
    if len(set(links)) < len(links):
        raise TaskError(f"touch of {arm!r} names a link twice: {shown(links)}")
    return tuple(links)


class Touch:
    """Reads the contact forces on links.

    Attributes:
        names: What they are called in observations: ``left.touch.panda_leftfinger``.
    """

    def __init__(self, links: Mapping[str, Sequence[str]]) -> None:
        """Take the links by arm; none feel nothing."""
        self._links = {f"{arm}.{TOUCH}.{ln}": (arm, ln) for arm, own in links.items() for ln in own}
        self.names = tuple(self._links)

    def read(self, state: State, elapsed: NDArray[np.int32]) -> dict[str, Floats]:
        """Return the force of all that touches each link, (N, 3) (N), in the link's frame.

        It is that of the last step of physics, and 0 after a reset, before there was one.

        Args:
            state: The worlds now.
            elapsed: Control steps since the reset, (N,).

        Raises:
            UnknownNameError: If a robot has no such link.
        """
        felt: dict[str, Floats] = {}
        for name, (arm, link) in self._links.items():
            force = state.contact_force(arm, link)
            turned = rotation_matrix(state.link_pose(arm, link)[:, 3:])
            own = np.add.reduce(turned * force[:, :, None], 1)
            felt[name] = np.where((elapsed > 0)[:, None], own, np.float32(0))
        return felt
