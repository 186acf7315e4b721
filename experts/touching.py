"""Which arms touch each other in a task, whether physics tells of it or not."""

from __future__ import annotations

from motion.cell import cell_of
from robots.bodies.hulls import require_packages
from robots.common.errors import MissingPackageError
from simulation.parts import Part
from tasks import MultiRobotTask


class ArmWatch:
    """Looks at which arms of a task with one environment touch: robots, or limbs of one robot.

    Every contact counts that physics reports. In clones of ManiSkill's tasks, physics lets some
    links of two robots pass through each other, such as the fingers of two Pandas (see
    `simulation.World`); there overlaps of their shapes count, too, as they are when it is asked.
    That takes python-fcl; where it is not installed, they are not seen.
    """

    def __init__(self, task: MultiRobotTask) -> None:
        """Watch a task from now on."""
        self._task = task
        task.simulation.watch_arms()
        self._measures = task.simulation.links_pass and len(task.layout) > 1 and _can_measure()

    def touching(self) -> list[tuple[Part, Part]]:
        """Return which links of different arms touch, or have touched since it was last asked."""
        found = self._task.simulation.arms_touching(0)
        return [*found, *self._overlapping()] if self._measures else found

    def _overlapping(self) -> list[tuple[Part, Part]]:
        checker = cell_of(self._task.standing()).checker(own=None)
        joints = self._task.simulation.read().joint_positions[0]
        return [
            (_part(contact.names[0], contact.owners[0]), _part(contact.names[1], contact.owners[1]))
            for contact in checker.contacts(joints)
        ]


def _part(name: str, robot: str) -> Part:
    return Part(robot, name.removeprefix(f"{robot}/"))


def _can_measure() -> bool:
    try:
        require_packages()
    except MissingPackageError:
        return False
    return True
