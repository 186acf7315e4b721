"""Which robots there are: the built-in catalogue, registered descriptors, and entry points."""

from __future__ import annotations

from robots.common.catalogue import Catalogue
from robots.common.errors import DescriptorError, RobotLayoutsError
from robots.common.fields import show
from robots.descriptor import RobotDescriptor

# One line per robot, sorted by name: name -> module:attribute.
CATALOGUE = {
    "fetch": "robots.catalogue.fetch:FETCH",
    "floating_panda_gripper": "robots.catalogue.floating_panda_gripper:FLOATING_PANDA_GRIPPER",
    "koch": "robots.catalogue.koch:KOCH",
    "mobile_panda": "robots.catalogue.mobile_panda:MOBILE_PANDA",
    "panda": "robots.catalogue.panda:PANDA",
    "panda_pinch": "robots.catalogue.panda_pinch:PANDA_PINCH",
    "panda_stick": "robots.catalogue.panda_stick:PANDA_STICK",
    "panda_wristcam": "robots.catalogue.panda_wristcam:PANDA_WRISTCAM",
    "so100": "robots.catalogue.so100:SO100",
    "xarm7": "robots.catalogue.xarm7:XARM7",
}


def _check(given: object, origin: str, name: str | None = None) -> RobotDescriptor:
    """Return a descriptor that came from elsewhere, if it is one and goes by its name."""
    if not isinstance(given, RobotDescriptor):
        raise DescriptorError(
            f"{origin} gave {show(given)}, of type {type(given).__name__};"
            " a RobotDescriptor is needed"
        )
    if name is not None and given.name != name:
        raise DescriptorError(f"{origin} is listed as {name!r}, but its robot is {given.name!r}")
    return given


ROBOTS = Catalogue(
    "robot",
    CATALOGUE,
    group="robot_layouts.robots",
    check=_check,
    error=DescriptorError,
    hint="Add your own with RobotRegistry.register(descriptor).",
)


class RobotRegistry:
    """The names under which robots are known in this process."""

    @staticmethod
    def load(name: str) -> RobotDescriptor:
        """Return the descriptor registered under ``name``, touching none of its files.

        Looks at descriptors registered in this process, then at the built-in catalogue, then at
        the entry points ``robot_layouts.robots`` of installed packages.

        Raises:
            UnknownNameError: If no robot has that name (also a ``KeyError``).
            DescriptorError: If another package brings the robot, and that goes wrong.
        """
        if not isinstance(name, str):
            kind = f"of type {type(name).__name__}"
            raise ROBOTS.unknown(kind, "It takes a robot's name.")
        return ROBOTS[name]

    @staticmethod
    def names() -> tuple[str, ...]:
        """Return every robot name, sorted."""
        return tuple(ROBOTS)

    @staticmethod
    def load_all() -> tuple[list[RobotDescriptor], list[RobotLayoutsError]]:
        """Return every robot, sorted by name, and why those of other packages that fail do so."""
        return ROBOTS.load_all()

    @staticmethod
    def register(descriptor: RobotDescriptor) -> RobotDescriptor:
        """Make a descriptor loadable by its name in this process, and return it.

        Registering the same descriptor again is allowed.

        Raises:
            DescriptorError: If it is no descriptor, or another robot has that name.
        """
        name = _check(descriptor, "register").name
        if name in ROBOTS and ROBOTS[name] != descriptor:
            raise DescriptorError(
                f"another robot is already called {name!r};"
                " choose another name with dataclasses.replace(descriptor, name=...)"
            )
        ROBOTS.register(name, descriptor)
        return descriptor
