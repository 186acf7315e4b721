"""Which arms touch each other in a task, whether physics reports it or not."""

from __future__ import annotations

import warnings

from layouts import Layout
from robot_layouts.core.errors import MissingPackageError
from robot_layouts.motion.collision.cell import cell_of
from robot_layouts.motion.collision.checker import Checker
from robot_layouts.simulation.world import Part
from robots.bodies.hulls import require_packages
from tasks import TaskEnv

_UNSEEN = (
    "hands of robots that overlap are not seen, so plans may be others than elsewhere: python-fcl"
    " is not installed; pip install 'robot-layouts[checks]'"
)


class ArmWatch:
    """Looks at which arms of a task with one environment touch: robots, or limbs of one robot.

    Every contact counts that physics reports. In clones of ManiSkill's tasks, physics lets some
    links of two robots pass through each other, such as the fingers of two Pandas (see
    `World`); there overlaps of their shapes count, too, as they are when it is asked.
    """

    def __init__(self, task: TaskEnv, *, strict: bool = True) -> None:
        """Watch a task from now on.

        Args:
            task: A task with one environment.
            strict: Whether to refuse where overlaps count and python-fcl, which measures them, is
                not installed. Otherwise a warning says that they are not seen there.

        Raises:
            MissingPackageError: If it is refused.
        """
        self._task = task
        self._checker: tuple[Layout, Checker] | None = None
        self._measures = task.simulation.links_pass and len(task.layout) > 1
        if self._measures:
            try:
                require_packages()
            except MissingPackageError:
                if strict:
                    raise
                self._measures = False
                warnings.warn(_UNSEEN, RuntimeWarning, stacklevel=2)
        task.simulation.backend.watch_arms()

    def touching(self) -> list[tuple[Part, Part]]:
        """Return which links of different arms touch, or have touched since it was last asked."""
        found = self._task.simulation.backend.arms_touching(0)
        return [*found, *self._overlapping()] if self._measures else found

    def _overlapping(self) -> list[tuple[Part, Part]]:
        joints = self._task.simulation.read().joint_positions[0]
        return [
            (_part(contact.names[0], contact.owners[0]), _part(contact.names[1], contact.owners[1]))
            for contact in self._current_checker().contacts(joints)
        ]

    def _current_checker(self) -> Checker:
        """Return the checker for where robots stand, which is made once per standing."""
        standing = self._task.standing()
        if self._checker is None or self._checker[0] is not standing:
            self._checker = standing, cell_of(standing).checker(own=None)
        return self._checker[1]


def _part(name: str, robot: str) -> Part:
    return Part(robot, name.removeprefix(f"{robot}/"))
