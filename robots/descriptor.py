"""What a robot is: files, joint groups, gripper, keyframes; data that checks itself, no more."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Protocol, runtime_checkable

from robot_layouts.core.errors import DescriptorError, UnknownNameError, refuse
from robot_layouts.core.schema import check_fields
from robots.action_split import ActionNumber, ActionSplit, JointGroup, is_gripper, names
from robots.control_modes import CONTROL_MODES, MODES, driven_in
from robots.parts import (
    IDENTITY,
    CameraMount,
    Fingers,
    Frozen,
    GripperMaterial,
    Home,
    Limb,
    NativeAgent,
    Quaternion,
    Vector3,
    repeated,
    share_out,
)

__all__ = [
    "CONTROL_MODES",
    "IDENTITY",
    "ActionNumber",
    "ActionSplit",
    "CameraMount",
    "Fingers",
    "GripperMaterial",
    "Home",
    "JointGroup",
    "Limb",
    "NativeAgent",
    "Quaternion",
    "RobotDescriptor",
    "UrdfSource",
    "Vector3",
    "names",
]


@runtime_checkable
class UrdfSource(Protocol):
    """Where a URDF comes from; see `robots.assets.locator.UrdfLocator`."""

    def locate(self, *, pictures: bool = False) -> Path:
        """Return the path of a complete, checked URDF on this machine."""
        ...


class FromUrdf(Protocol):
    """The type of `RobotDescriptor.from_urdf`."""

    def __call__(
        self,
        path_or_name: str | os.PathLike[str],
        name: str | None = None,
        *,
        quiet: bool = False,
        xacro: Mapping[str, object] | None = None,
        srdf: str | os.PathLike[str] | None = None,
        folder: str | os.PathLike[str] | None = None,
        **overrides: Any,
    ) -> RobotDescriptor:
        """Guess a robot from its URDF, and say on stderr what was guessed and why.

        See `robots.from_urdf.guess_descriptor` for the arguments, the errors, and the guess with
        its reasons and the data module to paste.

        Args:
            path_or_name: A URDF on this machine, or a name of the package robot_descriptions.
            name: Registry name; None takes that of the URDF.
            quiet: Whether to say nothing.
            xacro: Arguments of a xacro template, as in ``{"prefix": "left_"}``.
            srdf: An SRDF: its groups, states, TCPs and disabled pairs are taken over.
            folder: A folder whose files may be read, too.
            **overrides: Fields that are known better than guessed. ``limbs={"left": "1"}`` calls
                the guessed limb 1 so; limbs that are left out are held still.
        """
        ...


class FromMjcf(Protocol):
    """The type of `RobotDescriptor.from_mjcf`."""

    def __call__(
        self,
        path_or_name: str | os.PathLike[str],
        name: str | None = None,
        *,
        quiet: bool = False,
        folder: str | os.PathLike[str] | None = None,
        **overrides: Any,
    ) -> RobotDescriptor:
        """Guess a robot from its MJCF, and say on stderr what was guessed and why.

        MuJoCo compiles the file (``pip install 'robot-layouts[mjcf]'``), and what it makes of it
        becomes a URDF. Keyframes, actuators, tool sites and excluded contacts are taken over.

        Args:
            path_or_name: An MJCF on this machine, or a name of the package robot_descriptions.
            name: Registry name; None takes that of the model.
            quiet: Whether to say nothing.
            folder: A folder whose files may be read, too.
            **overrides: Fields that are known better than guessed.
        """
        ...


class WithGripper(Protocol):
    """The type of `RobotDescriptor.with_gripper`."""

    def __call__(
        self, gripper: RobotDescriptor | str | os.PathLike[str], **details: Any
    ) -> RobotDescriptor:
        """Return the robot with another gripper in the place of its own, if it has one.

        Args:
            gripper: A descriptor, a registered name, the path of a URDF or MJCF, or ``MODULE:NAME``
                of a gripper, or of an arm whose gripper is taken.
            **details: ``link``, ``position``, ``quaternion`` and ``name``; see
                `robots.grafting.with_gripper`, also for the errors.
        """
        ...


@dataclass(frozen=True)
class RobotDescriptor:
    """Everything the library knows about one robot; frozen, and checked when made.

    Variants are made with `dataclasses.replace`.

    Attributes:
        name: Registry name, also the robot's key in ManiSkill's state dicts.
        urdf: Where its files come from.
        action_split: Its joint groups, in action order.
        tcp_link: Link whose frame orients the tool centre point.
        keyframes: Named joint positions, in the order of ``joints`` (rad, m). In ``pinch`` the
            fingers of a hand of many joints meet; at home it is open.
        source: Where the numbers of this descriptor come from.
        reach: Largest distance of the TCP from the base axis (m).
        tcp_position_links: Links whose mean origin is the TCP position; ``tcp_link`` if empty.
        gripper_material: Contact material of the fingers, if it has any.
        fingers: The links that grasp, if it has any.
        cameras: Cameras on its links.
        home: Default standing place and keyframe.
        tcp_offset: From there to the TCP, in the frame of ``tcp_link`` (m).
        allowed_collisions: Pairs of links that may overlap, besides those that a joint joins and
            those that are rigid with each other; checks and physics let them. None takes what
            ManiSkill's loader takes: of the SRDF beside the URDF the pairs of reason ``Default``.
        no_floor_contact: Links that floors let through, such as the wheels of a base that joints
            move along the floor and turn: in contact, they would hold it in its place.
        native_agent: What ManiSkill's agent of it reads otherwise than its other agents.
        limbs: The arms of a robot that has several, by name, such as ``left`` and ``right``;
            ``tcp_link``, ``fingers`` and ``reach`` are then those of the first one. A robot without
            limbs is one arm.
        control_modes: Joint groups, by their names, in control modes where they are not those that
            `robots.control_modes` makes of ``action_split``; also modes of the robot's own.
        declared_split: The action split as declared, once `in_control_mode` has made another of
            it. Two robots that are driven alike are equal, whatever they were declared as.
    """

    name: str
    urdf: UrdfSource
    action_split: ActionSplit
    tcp_link: str
    keyframes: Mapping[str, Sequence[float]]
    source: str
    reach: float
    tcp_position_links: tuple[str, ...] = ()
    gripper_material: GripperMaterial | None = None
    fingers: Fingers | None = None
    cameras: tuple[CameraMount, ...] = ()
    home: Home = field(default_factory=Home)
    allowed_collisions: tuple[tuple[str, str], ...] | None = None
    no_floor_contact: tuple[str, ...] = ()
    tcp_offset: Vector3 = (0.0, 0.0, 0.0)
    native_agent: NativeAgent = NativeAgent()
    limbs: Mapping[str, Limb] = field(default_factory=dict[str, Limb])
    control_modes: Mapping[str, Mapping[str, JointGroup]] = field(
        default_factory=dict[str, Mapping[str, JointGroup]]
    )
    declared_split: ActionSplit | None = field(default=None, compare=False)

    # Bound in `robots`: what reads files and fits grippers is built on descriptors.
    from_urdf: ClassVar[FromUrdf]
    """Guess a robot from its URDF; see `robots.from_urdf.guess_descriptor`."""
    from_mjcf: ClassVar[FromMjcf]
    """Guess a robot from its MJCF; see `robots.from_urdf.guess_descriptor`."""
    with_gripper: ClassVar[WithGripper]
    """Return the robot with another gripper; see `robots.grafting.with_gripper`."""

    def __post_init__(self) -> None:
        """Freeze the keyframes and refuse contradictions."""
        named = isinstance(self.name, str) and self.name.isprintable()
        check_fields(self, DescriptorError, owner=self.name if named else None)
        refuse(self._problems(), DescriptorError)
        frozen = {key: tuple(float(x) for x in qpos) for key, qpos in self.keyframes.items()}
        object.__setattr__(self, "keyframes", Frozen(frozen))
        self.keyframe(self.home.keyframe)
        object.__setattr__(self, "limbs", Frozen(self.limbs))
        self._owners()
        modes = {mode: Frozen(groups) for mode, groups in self.control_modes.items()}
        object.__setattr__(self, "control_modes", Frozen(modes))
        refuse(self._mode_problems(), DescriptorError)

    def _problems(self) -> Iterator[str]:
        if re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", self.name) is None:
            yield f"robot name {self.name!r} must be a letter followed by letters, digits and _"
        if not self.reach > 0:
            yield f"{self.name}: reach is {self.reach} m; it must be positive"
        yield from repeated(f"{self.name}: tcp_position_links", self.tcp_position_links)
        yield from repeated(f"{self.name}: no_floor_contact", self.no_floor_contact)
        yield from repeated(f"{self.name}: cameras", [camera.name for camera in self.cameras])
        pairs = self.allowed_collisions or ()
        for i, pair in enumerate(pairs):
            yield from repeated(f"{self.name}: allowed_collisions[{i}]", pair)
        written = [" and ".join(sorted(pair)) for pair in pairs]
        yield from repeated(f"{self.name}: allowed_collisions", written)
        for key, qpos in self.keyframes.items():
            if len(qpos) != self.dof:
                yield (
                    f"{self.name}: keyframe {key!r} has {len(qpos)} numbers;"
                    f" the robot has {self.dof} joints ({', '.join(self.joints)})"
                )

    @property
    def parts(self) -> Mapping[str, RobotDescriptor]:
        """Who takes the action numbers of a robot with limbs, in their order; else nothing.

        Each limb by its name, and what is driven besides as ``body``, described like a robot: own
        joint groups, keyframes, TCP, fingers and reach.
        """
        owners = self._owners()
        return {
            part: self._described(part, [group for group, owner in owners.items() if owner == part])
            for part in dict.fromkeys(owners.values())
            if part is not None
        }

    @property
    def joints(self) -> tuple[str, ...]:
        """Driven joints, in the order of the action split."""
        return self.action_split.joints

    @property
    def arm_joints(self) -> tuple[str, ...]:
        """Joints of every group that is neither a gripper, by its name, nor held."""
        driven = [
            group
            for name, group in self.action_split.groups.items()
            if not is_gripper(name) and not group.held
        ]
        return tuple(joint for group in driven for joint in group.joints)

    @property
    def gripper_joints(self) -> tuple[str, ...]:
        """Joints of every group that is a gripper, by its name."""
        groups = self.action_split.groups.items()
        return tuple(joint for name, group in groups if is_gripper(name) for joint in group.joints)

    @property
    def dof(self) -> int:
        """Number of driven joints; a Panda has 9, as both fingers count."""
        return len(self.joints)

    @property
    def action_dim(self) -> int:
        """Number of action numbers; a Panda has 8, as one number moves both fingers."""
        return self.action_split.size

    @property
    def summary(self) -> str:
        """Both numbers in words: ``9 joints, 8 action numbers``."""
        counts = {"joint": self.dof, "action number": self.action_dim}
        return ", ".join(f"{count} {what}{'s' * (count != 1)}" for what, count in counts.items())

    def __repr__(self) -> str:
        """Show name, sizes and reach; the fields are many."""
        return f"RobotDescriptor({self.name!r}: {self.summary}, reach {self.reach:g} m)"

    def _repr_html_(self) -> str:
        """Show a notebook the table of action numbers."""
        from robot_layouts.core.pages import heading, table

        heads = ("#", "action number", "lowest", "highest", "unit", "joints")
        rows = [
            (str(n.index), n.name, f"{n.lower:g}", f"{n.upper:g}", n.unit, ", ".join(n.joints))
            for n in self.describe_action()
        ]
        return heading(self.name, f"{self.summary}, reach {self.reach:g} m") + table(heads, rows)

    def keyframe(self, name: str) -> tuple[float, ...]:
        """Return the joint positions of a keyframe (rad, m), in the order of ``joints``.

        Raises:
            UnknownNameError: If there is no such keyframe.
        """
        if name not in self.keyframes:
            raise UnknownNameError(f"keyframe of {self.name}", name, self.keyframes)
        return tuple(self.keyframes[name])

    @property
    def action_bounds(self) -> tuple[tuple[float, float], ...]:
        """The least and the largest value of each action number."""
        groups = self.action_split.groups.values()
        return tuple(bounds for group in groups for bounds in group.bounds)

    def _owners(self) -> dict[str, str | None]:
        """Return whose each joint group is, if there are limbs."""
        if not self.limbs:
            return {}
        try:
            return share_out(self.limbs, self.action_split)
        except DescriptorError as error:
            raise DescriptorError(f"{self.name}: {error}") from None

    def _described(self, part: str, groups: Sequence[str]) -> RobotDescriptor:
        """Return what is said of a part, as of a robot of its own."""
        split = ActionSplit(**{group: self.action_split.groups[group] for group in groups})
        places = [self.joints.index(joint) for joint in split.joints]
        limb = self.limbs.get(part)
        return replace(
            self,
            action_split=split,
            keyframes={key: [qpos[i] for i in places] for key, qpos in self.keyframes.items()},
            tcp_link=limb.tcp_link if limb else self.tcp_link,
            tcp_position_links=limb.tcp_position_links if limb else self.tcp_position_links,
            tcp_offset=limb.tcp_offset if limb else self.tcp_offset,
            fingers=limb and limb.fingers,
            reach=limb.reach if limb else self.reach,
            cameras=tuple(c for c in self.cameras if part in c.name.split("_")),
            limbs={},
            control_modes={},
            declared_split=None,
        )

    def _mode_problems(self) -> Iterator[str]:
        """Yield modes of the robot's own that drive groups which it does not have."""
        for mode, groups in self.control_modes.items():
            for name, group in groups.items():
                own = self.action_split.groups.get(name)
                if own is None or own.joints != group.joints:
                    yield (
                        f"{self.name}: control mode {mode!r} drives {name!r} with joints"
                        f" {', '.join(group.joints)}; the action split has no such group"
                    )

    @property
    def modes(self) -> tuple[str, ...]:
        """The control modes that may be asked of it: ManiSkill's, then its own."""
        return (*CONTROL_MODES, *(name for name in self.control_modes if name not in MODES))

    @property
    def control_mode(self) -> str | dict[str, str] | None:
        """The control mode that its action split is in, or those by limb.

        It is ``"pd_joint_delta_pos"`` as declared, and None if joint groups were changed since
        `in_control_mode`, so that it is in none.
        """
        if self.declared_split is None:
            return CONTROL_MODES[0]
        for mode in self.modes:
            if self._is_in(mode, self.action_split.groups):
                return mode
        by_limb: dict[str, str] = {}
        for limb, part in self.parts.items():
            own = [m for m in self.modes if self._is_in({limb: m}, part.action_split.groups)]
            by_limb.update(dict.fromkeys([limb], own[0]) if own else {})
        return by_limb if by_limb and set(by_limb) == set(self.parts) else None

    def _is_in(self, mode: str | Mapping[str, str], groups: Collection[str]) -> bool:
        """Tell whether some of its joint groups are driven as a control mode drives them."""
        try:
            made = self._driven_in(mode).groups
        except DescriptorError:  # it lacks what that mode needs
            return False
        return all(made[group] == self.action_split.groups[group] for group in groups)

    def in_control_mode(self, mode: str | Mapping[str, str]) -> RobotDescriptor:
        """Return the robot with the actions of a control mode, whichever it is in.

        ``pd_joint_delta_pos`` is the action split as declared. The other modes of joint positions
        change every group that is relative there, those of velocities all but grippers, and those
        of the TCP (``pd_ee_…``) the arm alone, as in ManiSkill; see `robots.control_modes`. What
        takes no action number at all goes on taking none.

        Args:
            mode: Name of a mode, or one by limb; limbs that are left out stay as they are.

        Raises:
            UnknownNameError: If there is no such control mode, or no such limb.
            DescriptorError: If the robot lacks what the mode needs: joint limits, or an arm.
        """
        if self.control_mode is None:
            raise DescriptorError(
                f"{self.name} was put into a control mode, and its joint groups were changed then;"
                " change them first"
            )
        split, declared = self._driven_in(mode), self.declared_split or self.action_split
        if split == self.action_split:
            return self
        return replace(
            self, action_split=split, declared_split=None if split == declared else declared
        )

    def _driven_in(self, mode: str | Mapping[str, str]) -> ActionSplit:
        """Return the action split of a control mode, made of the declared one."""
        whole = self
        if self.declared_split is not None:
            whole = replace(self, action_split=self.declared_split, declared_split=None)
        parts = whole.parts or {self.name: whole}
        chosen = mode if isinstance(mode, Mapping) else dict.fromkeys(parts, mode)
        changed: dict[str, JointGroup] = {}
        for part, name in chosen.items():
            if part not in parts:
                raise UnknownNameError(f"limb of {self.name}", part, parts)
            if name not in self.modes:
                raise UnknownNameError("control mode", name, self.modes)
            split, own = parts[part].action_split, self.control_modes.get(name, {})
            if not split.size:  # all of it is held, and stays so
                continue
            changed.update(split.groups)
            try:
                has_tcp = not self.limbs or part in self.limbs
                changed.update(driven_in(name, split, own, has_tcp=has_tcp))
            except DescriptorError as error:
                raise DescriptorError(f"{self.name}: {error}") from None
        if not changed:  # all of the robot is held
            return self.action_split
        return self.action_split.replace(**changed)

    def describe_action(self) -> tuple[ActionNumber, ...]:
        """Return name, unit and range of every action number, in order."""
        numbers: list[ActionNumber] = []
        for group_name, group in self.action_split.groups.items():
            if group.held:
                continue
            driven = [(joint,) for joint in group.joints] * 2  # by positions, and by velocities
            if group.asks.drive:
                driven = [group.joints[:2], group.joints[2:]]
            each = not (group.mimic or group.asks.tcp)
            for i, ((moved, unit), (lower, upper)) in enumerate(
                zip(group.numbers, group.ranges, strict=not group.mimic)
            ):
                # A turn is scaled by its lower bound, as in ManiSkill.
                turned = group.normalised and group.asks.tcp and unit == "rad"
                relative = group.delta and not unit.endswith("/s")
                numbers.append(
                    ActionNumber(
                        index=len(numbers),
                        name=group_name if group.mimic else f"{group_name}.{moved}",
                        group=group_name,
                        joints=driven[i] if each else group.joints,
                        unit=f"{unit} per step" if relative else unit,
                        lower=-lower if turned else lower,
                        upper=lower if turned else upper,
                        relative=relative,
                        normalised=group.normalised,
                    )
                )
        return tuple(numbers)
