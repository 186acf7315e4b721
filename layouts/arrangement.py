"""Which robots stand where, under what names, and in what order: the data of a layout."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType
from typing import TypeVar

from layouts.frames import ORIGIN, Frame, HangingError, Pose, check_frame_names, numbers, resolve
from layouts.placement import Placement, RobotLike, placed
from robot_layouts.core.bounds import FAR, checked_number, shown
from robot_layouts.kinematics.quaternions import yaw_quaternion
from robots import CONTROL_MODES, LayoutError, UnknownNameError
from robots.descriptor import Vector3
from robots.parts import BODY

_Self = TypeVar("_Self", bound="Arrangement")


class Arrangement(Mapping[str, Placement]):
    """Ordered, named placements: a read-only mapping from name to `Placement`.

    The data of a `layouts.Layout`, which adds what one asks of a layout.

    The order is the order of the robots' action numbers. Two layouts are equal if they place the
    same robots under the same names in the same order.
    """

    _frames: dict[str, Frame]
    _placements: dict[str, Placement]

    def __init__(
        self, placements: Mapping[str, Placement], frames: Mapping[str, Frame] | None = None
    ) -> None:
        """Take placements in the order given, and resolve where those that hang are.

        Args:
            placements: Placement by name, in action order.
            frames: Frame by name, for placements and other frames to hang on.

        Raises:
            LayoutError: If there is no placement, a name is not an identifier or is given twice,
                or something hangs on what is not there or on itself.
        """
        for what, given in (("placements", placements), ("frames", frames or {})):
            if not isinstance(given, Mapping):
                raise LayoutError(f"{what} is {shown(given)}; it takes a mapping by name")
        frames = {} if frames is None else dict(frames)
        if not placements:
            raise LayoutError("a layout needs at least one robot")
        for name, placement in placements.items():
            check_name(name)
            if not isinstance(placement, Placement):
                raise LayoutError(
                    f"{name!r} is a {type(placement).__name__}; a layout holds Placements"
                )
            if name in frames:
                raise HangingError(f"{name!r} names both a robot and a frame; rename one", name)
        check_frame_names(frames)
        poses = {name: (thing.on, thing.local_pose) for name, thing in frames.items()}
        poses.update({name: (thing.on, thing.local_pose) for name, thing in placements.items()})
        world = resolve(poses)
        object.__setattr__(self, "_frames", frames)
        object.__setattr__(
            self, "_placements", {n: placed(p, world[n]) for n, p in placements.items()}
        )

    @classmethod
    def of(
        cls: type[_Self],
        *placements: tuple[str, Placement],
        frames: Mapping[str, Frame] | None = None,
    ) -> _Self:
        """Build from (name, placement) pairs; a name given twice is an error, not an overwrite.

        Raises:
            LayoutError: If a name appears twice, or one of them is no pair.
        """
        for pair in placements:
            if not (isinstance(pair, tuple) and len(pair) == 2):
                raise LayoutError(f"{shown(pair)} is no pair of a name and a Placement")
        names = [name for name, _ in placements]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise LayoutError(f"names {twice} are given twice; each robot needs its own name")
        return cls(dict(placements), frames)

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse: a layout is frozen."""
        raise AttributeError(f"Layout is frozen; {name!r} cannot be set")

    def __getitem__(self, name: str) -> Placement:
        """Return the placement called ``name``."""
        if not isinstance(name, str) or name not in self._placements:
            raise UnknownNameError("robot of this layout", name, self._placements)
        return self._placements[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names in action order."""
        return iter(self._placements)

    def __len__(self) -> int:
        """Return the number of robots."""
        return len(self._placements)

    def __eq__(self, other: object) -> bool:
        """Compare names, order, placements and frames as they were declared."""
        if not isinstance(other, Arrangement):
            return NotImplemented
        return list(self.items()) == list(other.items()) and self._frames == other._frames

    def __hash__(self) -> int:
        """Hash names, order, placements and frames."""
        return hash((tuple(self.items()), frozenset(self._frames.items())))

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle by the placements and frames."""
        return (type(self), (dict(self._placements), self._frames))

    def __repr__(self) -> str:
        """Show names and robots in order."""
        return f"{type(self).__name__}({', '.join(f'{n}={p.robot.name}' for n, p in self.items())})"

    @property
    def frames(self) -> Mapping[str, Frame]:
        """The named frames, as they were declared."""
        return MappingProxyType(self._frames)

    @property
    def frame_poses(self) -> dict[str, Pose]:
        """World pose of each frame, by name."""
        poses = {name: (frame.on, frame.local_pose) for name, frame in self._frames.items()}
        poses.update({name: (None, placement.base_pose) for name, placement in self.items()})
        world = resolve(poses)
        return {name: world[name] for name in self._frames}

    @property
    def parts(self) -> dict[str, Placement]:
        """Who takes action numbers, in their order: each robot, or its limbs if it has some.

        A limb is called ``robot.limb``, and what its robot drives besides ``robot.body``. Its
        placement holds its own part of the descriptor, and stands where the limb begins.
        """
        return dict(self._parts)

    @cached_property
    def _parts(self) -> dict[str, Placement]:
        parts: dict[str, Placement] = {}
        for name, placement in self.items():
            own = placement.parts
            parts.update({f"{name}.{part}": where for part, where in own.items()})
            parts.update({} if own else {name: placement})
        return parts

    @property
    def arms(self) -> dict[str, Placement]:
        """The `parts` that have a tool centre point: robots, or their limbs if they have some."""
        return {n: part for n, part in self._parts.items() if n.rpartition(".")[2] != BODY}

    @property
    def short_names(self) -> dict[str, str]:
        """The limbs that go by their own name: those that no other robot or limb is called like."""
        return dict(self._short_names)

    @cached_property
    def _short_names(self) -> dict[str, str]:
        limbs = [(part.partition(".")[2], part) for part in self.arms if part not in self]
        called = Counter([*self, *(limb for limb, _ in limbs)])
        return {limb: part for limb, part in limbs if called[limb] == 1}

    @property
    def arms_by_group(self) -> dict[tuple[str, str], str]:
        """The arm that each joint group belongs to, by the names of robot and group."""
        return {
            (arm.partition(".")[0], group): arm
            for arm, placement in self.arms.items()
            for group in placement.robot.action_split
        }

    @property
    def places(self) -> dict[str, str]:
        """The `arms` by the names that they go by in a task: the short one, where there is one."""
        short = {full: name for name, full in self.short_names.items()}
        return {short.get(arm, arm): arm for arm in self.arms}

    def arm(self, name: str) -> Placement:
        """Return a robot, or a limb by its full name or its short one, described like a robot.

        Raises:
            UnknownNameError: If there is none of that name.
        """
        full = self.arm_name(name)
        return self[full] if full in self else self._parts[full]

    def arm_name(self, name: str) -> str:
        """Return the full name of a robot or a limb.

        Raises:
            UnknownNameError: If there is none of that name.
        """
        full = self._short_names.get(name, name)
        if full not in self._parts and full not in self:
            known = {**self._parts, **self, **self._short_names}
            raise UnknownNameError("robot of this layout", name, known)
        return full

    def owner(self, name: str) -> str:
        """Return the robot that an arm belongs to: itself, unless it is a limb.

        Raises:
            UnknownNameError: If there is no arm of that name.
        """
        return self.arm_name(name).partition(".")[0]

    @property
    def action_split(self) -> dict[str, slice]:
        """The slice of the flat action that each of `parts` takes, in declared order."""
        return _slices(self._acting.parts)

    @property
    def robot_actions(self) -> dict[str, slice]:
        """The slice of the flat action that each robot takes, all its limbs together."""
        return _slices(self._acting)

    @property
    def action_dim(self) -> int:
        """How many numbers the flat action of all robots has."""
        return sum(placement.robot.action_dim for placement in self._acting.values())

    @property
    def control_modes(self) -> dict[str, str]:
        """The control modes that places say, by robot or by the full name of a limb."""
        return {
            f"{name}.{limb}" if limb else name: mode
            for name, placement in self.items()
            for limb, mode in placement.own_modes.items()
        }

    @property
    def present_modes(self) -> dict[str, str | None]:
        """The control modes that places say, and those that other robots were put into.

        By robot or by the full name of a limb; robots as they were declared are left out. None is
        one that was changed since, and is in none of its modes.
        """
        found: dict[str, str | None] = {}
        for name, placement in self.items():
            mode = placement.robot.control_mode
            if isinstance(mode, Mapping):
                found.update({f"{name}.{limb}": own for limb, own in mode.items()})
            elif mode != CONTROL_MODES[0]:
                found[name] = mode
        return self._overruled(found, self.control_modes)

    def control_mode(self, asked: str | Mapping[str, str] | None = None) -> str | dict[str, str]:
        """Return the control mode of all robots, or those by arm.

        Args:
            asked: A mode for all of them, or by arm; what is left out is as the places say, and
                where they do not, as the robots are: in ``"pd_joint_delta_pos"``, or in what
                `in_control_mode` put them into.

        Raises:
            UnknownNameError: If there is no such arm.
            LayoutError: If a robot that is left out is in none of its modes.
        """
        if asked is not None and not isinstance(asked, Mapping):
            return asked  # whatever it is, the robots know whether it is a mode
        modes: dict[str, str] = {}
        for arm, mode in self._overruled(self.present_modes, asked or {}).items():
            if mode is None:
                raise LayoutError(
                    f"{arm!r}: the joint groups of {self[arm].robot.name} were changed after"
                    " in_control_mode, and are in none of its control modes; change them first"
                )
            modes[arm] = mode
        alike = set(modes.values())
        if not (asked or self.control_modes) and list(modes) == list(self) and len(alike) == 1:
            return alike.pop()
        return modes or CONTROL_MODES[0]

    def _overruled(
        self, modes: Mapping[str, str | None], others: Mapping[str, str]
    ) -> dict[str, str | None]:
        """Return control modes by arm with those of others in their place, and of their limbs."""
        named = {self.arm_name(arm) for arm in others}
        kept = {a: m for a, m in modes.items() if not {self.arm_name(a), self.owner(a)} & named}
        return {**kept, **others}

    def replace_robots(self: _Self, **robots: RobotLike) -> _Self:
        """Return the layout with other robots in some places, facing the same way.

        Args:
            robots: Robot by place name, as a `Placement` takes it.

        Raises:
            UnknownNameError: If a place, a robot or the place's keyframe does not exist.
        """
        return self._with({name: self[name].with_robot(robot) for name, robot in robots.items()})

    def moved(self: _Self, position: Vector3 = ORIGIN, yaw: float = 0.0) -> _Self:
        """Return the whole layout, its frames included, turned about z and then shifted.

        What hangs on a frame or robot follows it, and stays declared as it was.

        Args:
            position: Shift (m).
            yaw: Turn about the world's z axis (rad).

        Raises:
            LayoutError: If they are not finite.
        """
        yaw = checked_number("yaw", yaw, -FAR, FAR, LayoutError, "rad")
        x, y, z = numbers("position", position, 3)
        move = Pose((x, y, z), yaw_quaternion(yaw))
        return type(self)(
            {name: _moved(placement, move) for name, placement in self.items()},
            {name: _moved(frame, move) for name, frame in self._frames.items()},
        )

    @property
    def action_bounds(self) -> tuple[tuple[float, float], ...]:
        """The least and the largest value of each number of the flat action."""
        return tuple(b for one in self._acting.values() for b in one.robot.action_bounds)

    def in_control_mode(self: _Self, mode: str | Mapping[str, str] | None = None) -> _Self:
        """Return the layout with robots that take the actions of a control mode.

        Their places say no mode any more; `control_mode` goes on telling it.

        Args:
            mode: Name of a mode, or one by arm: a robot, or a limb by its full name or its short
                one. Arms that are left out take the mode that their place says, or stay as they
                are.

        Raises:
            UnknownNameError: If there is no such control mode, or no such arm.
            DescriptorError: If a robot lacks what the mode needs; see
                `robots.RobotDescriptor.in_control_mode`.
        """
        mode = self.control_mode(mode)
        if not isinstance(mode, Mapping):
            chosen: dict[str, str | Mapping[str, str]] = dict.fromkeys(self, mode)
        else:
            chosen = {**self._modes_by_robot(mode)}
        robots = {name: self[name].robot.in_control_mode(own) for name, own in chosen.items()}
        changed = {name: replace(self[name], control_mode=None) for name in robots}
        return self._with({name: changed[name].with_robot(r) for name, r in robots.items()})

    @property
    def _acting(self: _Self) -> _Self:
        """The layout with robots that take the actions of the modes that their places say."""
        return self.in_control_mode(self.control_modes) if self.control_modes else self

    def _modes_by_robot(self, modes: Mapping[str, str]) -> dict[str, str | dict[str, str]]:
        """Return the mode of each robot that some are named for, or those of its limbs."""
        chosen: dict[str, str | dict[str, str]] = {}
        for arm, mode in modes.items():
            owner = self.owner(arm)
            own = chosen.setdefault(owner, {} if self[owner].robot.parts else mode)
            if isinstance(own, dict):
                limb = self.arm_name(arm).partition(".")[2]
                own.update(dict.fromkeys([limb] if limb else self[owner].robot.parts, mode))
        return chosen

    def _with(self: _Self, changed: Mapping[str, Placement]) -> _Self:
        return type(self)({**self._placements, **changed}, self._frames)


def _slices(parts: Mapping[str, Placement]) -> dict[str, slice]:
    split: dict[str, slice] = {}
    start = 0
    for name, placement in parts.items():
        split[name] = slice(start, start + placement.robot.action_dim)
        start += placement.robot.action_dim
    return split


def check_name(name: object) -> None:
    """Refuse a robot's name that is not an identifier.

    Raises:
        LayoutError: If it is not.
    """
    if not (isinstance(name, str) and name.isidentifier()):
        raise LayoutError(f"robot name {name!r} must be a letter followed by letters, digits and _")


_Declared = TypeVar("_Declared", Placement, Frame)


def _moved(declared: _Declared, move: Pose) -> _Declared:
    if declared.on is not None:
        return declared
    pose = move.then(declared.local_pose)
    return replace(declared, position=pose.position, quaternion=pose.quaternion, rpy=None)
