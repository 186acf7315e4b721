"""Which robots stand where, under what names, and in what order."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from layouts.description import describe
from robots import LayoutError, RobotDescriptor, RobotRegistry, UnknownNameError
from robots.descriptor import Quaternion, Vector3

if TYPE_CHECKING:
    from layouts.validation import Report

RobotLike = str | RobotDescriptor

_UNIT_TOLERANCE = 1e-6  # rounding of a quaternion written with seven digits


@dataclass(frozen=True)
class Placement:
    """One robot's place: where its base is fixed, and the joint positions it starts from.

    What is left out is the robot's own `robots.Home`, so that another robot can take the place.

    Attributes:
        robot: Its descriptor; a registry name is accepted and looked up.
        position: Base position in the world (m), or None for the robot's home.
        quaternion: Base orientation in the world, wxyz, unit length, or None for home.
        keyframe: Keyframe it starts from, or None for home.
        qpos_noise: Standard deviation of the joint noise added at a reset (rad).
    """

    robot: RobotDescriptor
    position: Vector3 | None = None
    quaternion: Quaternion | None = None
    keyframe: str | None = None
    qpos_noise: float = 0.02

    def __post_init__(self) -> None:
        """Look a robot's name up, and refuse poses that are no poses."""
        object.__setattr__(self, "robot", load_robot(self.robot))
        if self.position is not None:
            object.__setattr__(self, "position", _numbers("position", self.position, 3))
        if self.quaternion is not None:
            quaternion = _numbers("quaternion", self.quaternion, 4)
            length = math.sqrt(sum(x * x for x in quaternion))
            if abs(length - 1) > _UNIT_TOLERANCE:
                raise LayoutError(
                    f"quaternion {quaternion} has length {length:.6g}; a rotation has length 1"
                    " (order w, x, y, z)"
                )
            object.__setattr__(self, "quaternion", quaternion)
        if self.keyframe is not None:
            self.robot.keyframe(self.keyframe)
        if not (math.isfinite(self.qpos_noise) and self.qpos_noise >= 0):
            raise LayoutError(f"qpos_noise is {self.qpos_noise} rad; it must be 0 or more")

    @property
    def base_position(self) -> Vector3:
        """Base position in the world (m)."""
        return self.robot.home.position if self.position is None else self.position

    @property
    def base_quaternion(self) -> Quaternion:
        """Base orientation in the world, wxyz."""
        return self.robot.home.quaternion if self.quaternion is None else self.quaternion

    @property
    def start_keyframe(self) -> str:
        """Name of the keyframe the robot starts from."""
        return self.robot.home.keyframe if self.keyframe is None else self.keyframe

    @property
    def start_qpos(self) -> tuple[float, ...]:
        """Joint positions of ``start_keyframe``, in the order of the robot's joints (rad, m)."""
        return self.robot.keyframe(self.start_keyframe)


class Layout(Mapping[str, Placement]):
    """Ordered, named placements: a read-only mapping from name to `Placement`.

    The order is the order of the robots' action numbers. Two layouts are equal if they place the
    same robots under the same names in the same order.
    """

    __slots__ = ("_placements",)

    def __init__(self, placements: Mapping[str, Placement]) -> None:
        """Take placements in the order given.

        Args:
            placements: Placement by name, in action order.

        Raises:
            LayoutError: If there is none, or a name is not an identifier.
        """
        if not placements:
            raise LayoutError("a layout needs at least one robot")
        for name, placement in placements.items():
            if not (isinstance(name, str) and name.isidentifier()):
                raise LayoutError(
                    f"robot name {name!r} must be a letter followed by letters, digits and _"
                )
            if not isinstance(placement, Placement):
                raise LayoutError(
                    f"{name!r} is a {type(placement).__name__}; a layout holds Placements"
                )
        object.__setattr__(self, "_placements", dict(placements))

    @classmethod
    def of(cls, *placements: tuple[str, Placement]) -> Layout:
        """Build from (name, placement) pairs; a name given twice is an error, not an overwrite.

        Raises:
            LayoutError: If a name appears twice.
        """
        names = [name for name, _ in placements]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise LayoutError(f"names {twice} are given twice; each robot needs its own name")
        return cls(dict(placements))

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse: a layout is frozen."""
        raise AttributeError(f"Layout is frozen; {name!r} cannot be set")

    def __getitem__(self, name: str) -> Placement:
        """Return the placement called ``name``."""
        if name not in self._placements:
            raise UnknownNameError("robot of this layout", name, self._placements)
        return self._placements[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names in action order."""
        return iter(self._placements)

    def __len__(self) -> int:
        """Return the number of robots."""
        return len(self._placements)

    def __eq__(self, other: object) -> bool:
        """Compare names, order and placements."""
        if not isinstance(other, Layout):
            return NotImplemented
        return list(self.items()) == list(other.items())

    def __hash__(self) -> int:
        """Hash names, order and placements."""
        return hash(tuple(self.items()))

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle by the placements."""
        return (Layout, (dict(self._placements),))

    def __repr__(self) -> str:
        """Show names and robots in order."""
        return f"Layout({', '.join(f'{n}={p.robot.name}' for n, p in self.items())})"

    def __str__(self) -> str:
        """Show a table: name, robot, action numbers, base pose, keyframe and reach of each."""
        return describe(self)

    @property
    def action_split(self) -> dict[str, slice]:
        """The slice of the flat action that each robot takes, in declared order."""
        split: dict[str, slice] = {}
        start = 0
        for name, placement in self.items():
            split[name] = slice(start, start + placement.robot.action_dim)
            start += placement.robot.action_dim
        return split

    @property
    def action_dim(self) -> int:
        """How many numbers the flat action of all robots has."""
        return sum(placement.robot.action_dim for placement in self.values())

    def replace_robots(self, **robots: RobotLike) -> Layout:
        """Return the layout with other robots in some places.

        Args:
            robots: Robot (name or descriptor) by place name.

        Raises:
            UnknownNameError: If a place, a robot or the place's keyframe does not exist.
        """
        for name in robots:
            self[name]
        return Layout(
            {
                name: replace(placement, robot=load_robot(robots[name]))
                if name in robots
                else placement
                for name, placement in self.items()
            }
        )

    @property
    def action_bounds(self) -> tuple[tuple[float, float], ...]:
        """The least and the largest value of each number of the flat action."""
        return tuple(b for placement in self.values() for b in placement.robot.action_bounds)

    def in_control_mode(self, mode: str) -> Layout:
        """Return the layout with robots that take the actions of a control mode.

        Raises:
            UnknownNameError: If there is no such control mode.
            DescriptorError: If a robot lacks the joint limits that the mode needs.
        """
        return self.replace_robots(**{n: p.robot.in_control_mode(mode) for n, p in self.items()})

    def preview(
        self,
        path: str | PathLike[str],
        *,
        table: tuple[float, float, float, float] | None = None,
    ) -> Path:
        """Save a picture of the layout from above: bases, headings, reach and its overlap.

        Needs matplotlib, but neither robot files nor a graphics driver.

        Args:
            path: Where to save; the ending chooses the format (.png, .pdf or .svg).
            table: Outline of a table, as x_min, y_min, x_max, y_max (m).

        Returns:
            The path of the picture.

        Raises:
            LayoutError: If the ending names no supported format, or the table is no rectangle.
            MissingPackageError: If matplotlib is not installed.
        """
        from layouts.preview import preview

        return preview(self, path, table)

    def validate(
        self,
        *,
        targets: Mapping[str, Sequence[float]] | Sequence[Sequence[float]] = (),
        samples: int = 20,
        table: tuple[float, float, float, float] | None = None,
        seed: int = 0,
        workspaces: bool = True,
    ) -> Report:
        """Check the layout before anything moves, from the robots' real collision shapes.

        Looks for robots that collide with each other, with themselves or with a table at their
        keyframes and with joint noise, for keyframes beyond the joint limits, and for targets that
        nobody reaches; measures distances and shared workspaces. Needs the robots' files.

        Args:
            targets: What some robot must reach, by name or in order: x, y, z of a tool centre
                point in the world (m), or these and the wxyz quaternion of the TCP link.
            samples: How many postures with joint noise to look at, besides the keyframes.
            table: Outline of a table whose top is at z = 0, as x_min, y_min, x_max, y_max (m);
                bases may stand on it. None for no table.
            seed: Of the joint noise.
            workspaces: Whether to measure how much space robots share, to about a tenth.

        Returns:
            The report: ``ok``, ``findings``, a readable ``str`` and ``picture(path)``.

        Raises:
            LayoutError: If an argument makes no sense.
            AssetError: If a robot's files cannot be found or make no sense.
            DescriptorError: If a robot's descriptor contradicts its URDF.
            MissingPackageError: If python-fcl is not installed.
        """
        from layouts.validation import validate

        return validate(
            self, targets=targets, samples=samples, table=table, seed=seed, workspaces=workspaces
        )


def load_robot(robot: RobotLike) -> RobotDescriptor:
    """Return a descriptor as it is, or look a name up in the registry.

    Raises:
        UnknownNameError: If no robot has that name.
    """
    return robot if isinstance(robot, RobotDescriptor) else RobotRegistry.load(robot)


def _numbers(what: str, values: object, count: int) -> tuple[float, ...]:
    try:
        numbers = tuple(float(x) for x in values)  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        raise LayoutError(f"{what} is {values!r}; it takes {count} numbers") from None
    if len(numbers) != count or not all(math.isfinite(x) for x in numbers):
        raise LayoutError(f"{what} is {numbers}; it takes {count} finite numbers")
    return numbers
