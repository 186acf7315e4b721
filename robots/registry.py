"""Which robots there are: the built-in catalogue, registered descriptors, and entry points."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import import_module, metadata

from robots.common.errors import DescriptorError, RobotLayoutsError, UnknownNameError
from robots.common.fields import show
from robots.descriptor import RobotDescriptor

ENTRY_POINT_GROUP = "robot_layouts.robots"

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
            DescriptorError: If another package brings the robot, and that goes wrong.
        """
        if not isinstance(name, str):
            kind = f"of type {type(name).__name__}"
            raise UnknownNameError("robot", kind, cls.names(), "It takes a robot's name.")
        if name in cls._registered:
            return cls._registered[name]
        if name in CATALOGUE:
            module, _, attribute = CATALOGUE[name].partition(":")
            return getattr(import_module(module), attribute)
        if brought := [point for point in _entry_points() if point.name == name]:
            return _load(name, brought)
        raise UnknownNameError(
            "robot", name, cls.names(), "Add your own with RobotRegistry.register(descriptor)."
        )

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Return every robot name, sorted."""
        entry_points = (point.name for point in _entry_points())
        return tuple(sorted({*cls._registered, *CATALOGUE, *entry_points}))

    @classmethod
    def load_all(cls) -> tuple[list[RobotDescriptor], list[DescriptorError]]:
        """Return every robot, sorted by name, and why those of other packages that fail do so."""
        robots: list[RobotDescriptor] = []
        failures: list[DescriptorError] = []
        for name in cls.names():
            try:
                robots.append(cls.load(name))
            except DescriptorError as error:
                failures.append(error)
        return robots, failures

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


def _entry_points() -> Iterable[metadata.EntryPoint]:
    return metadata.entry_points(group=ENTRY_POINT_GROUP)


def _load(name: str, brought: Sequence[metadata.EntryPoint]) -> RobotDescriptor:
    """Return the robot that other packages bring under a name."""
    origins = {point.value: f"entry point {point.value!r}{_of_package(point)}" for point in brought}
    if len(origins) > 1:
        raise DescriptorError(
            f"the robot {name!r} is brought more than once, by {' and by '.join(origins.values())};"
            " uninstall all packages but one, or register the one that is meant"
        )
    ((_, origin),) = origins.items()
    try:
        found = brought[0].load()
    except RobotLayoutsError as error:
        raise DescriptorError(f"{origin} cannot be loaded: {error}") from error
    except (Exception, SystemExit) as error:  # whatever the code of another package does
        raise DescriptorError(f"{origin} cannot be loaded: {_in_words(error)}") from error
    robot = _checked(found, origin)
    if robot.name != name:
        raise DescriptorError(f"{origin} is listed as {name!r}, but its robot is {robot.name!r}")
    return robot


def _of_package(point: metadata.EntryPoint) -> str:
    return f" of {point.dist.name} {point.dist.version}" if point.dist is not None else ""


def _in_words(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__


def _checked(descriptor: object, origin: str) -> RobotDescriptor:
    if not isinstance(descriptor, RobotDescriptor):
        raise DescriptorError(
            f"{origin} gave {show(descriptor)}, of type {type(descriptor).__name__};"
            " a RobotDescriptor is needed"
        )
    return descriptor
