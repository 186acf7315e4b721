"""Which robots there are: the built-in catalogue, registered descriptors, and entry points."""

from __future__ import annotations

from importlib import import_module, metadata

from robots.descriptor import RobotDescriptor
from robots.errors import DescriptorError, UnknownNameError

ENTRY_POINT_GROUP = "robot_layouts.robots"

# One line per robot, sorted by name: name -> module:attribute.
CATALOGUE = {
    "fetch": "robots.fetch:FETCH",
    "floating_panda_gripper": "robots.floating_panda_gripper:FLOATING_PANDA_GRIPPER",
    "koch": "robots.koch:KOCH",
    "mobile_panda": "robots.mobile_panda:MOBILE_PANDA",
    "panda": "robots.panda:PANDA",
    "panda_pinch": "robots.panda_pinch:PANDA_PINCH",
    "panda_stick": "robots.panda_stick:PANDA_STICK",
    "panda_wristcam": "robots.panda_wristcam:PANDA_WRISTCAM",
    "so100": "robots.so100:SO100",
    "xarm7": "robots.xarm7:XARM7",
}


class RobotRegistry:
    """The names under which robots are known in this process."""

    _registered: dict[str, RobotDescriptor] = {}

    @classmethod
    def load(cls, name: str) -> RobotDescriptor:
        """Return the descriptor registered under ``name``, touching none of its files.

        Looks at descriptors registered in this process, then at the built-in catalogue, then at
        the entry points ``robot_layouts.robots`` of installed packages.

        Raises:
            UnknownNameError: If no robot has that name (also a ``KeyError``).
        """
        if not isinstance(name, str):
            raise UnknownNameError("robot", name, cls.names(), "It takes a robot's name.")
        if name in cls._registered:
            return cls._registered[name]
        if name in CATALOGUE:
            module, _, attribute = CATALOGUE[name].partition(":")
            return getattr(import_module(module), attribute)
        for entry_point in metadata.entry_points(group=ENTRY_POINT_GROUP):
            if entry_point.name == name:
                return _checked(entry_point.load(), f"entry point {entry_point.value!r}")
        raise UnknownNameError(
            "robot", name, cls.names(), "Add your own with RobotRegistry.register(descriptor)."
        )

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return every robot name, sorted."""
        entry_points = (point.name for point in metadata.entry_points(group=ENTRY_POINT_GROUP))
        return tuple(sorted({*cls._registered, *CATALOGUE, *entry_points}))

    @classmethod
    def register(cls, descriptor: RobotDescriptor) -> RobotDescriptor:
        """Make a descriptor loadable by its name in this process, and return it.

        Registering the same descriptor again is allowed.

        Raises:
            DescriptorError: If it is no descriptor, or another robot has that name.
        """
        _checked(descriptor, "register")
        if descriptor.name in cls.names() and cls.load(descriptor.name) != descriptor:
            raise DescriptorError(
                f"another robot is already called {descriptor.name!r};"
                " choose another name with dataclasses.replace(descriptor, name=...)"
            )
        cls._registered[descriptor.name] = descriptor
        return descriptor


def _checked(descriptor: object, origin: str) -> RobotDescriptor:
    if not isinstance(descriptor, RobotDescriptor):
        raise DescriptorError(
            f"{origin} gave a {type(descriptor).__name__}; a RobotDescriptor is needed"
        )
    return descriptor
