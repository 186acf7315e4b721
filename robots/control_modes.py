"""Control modes: what the action numbers of a robot mean, by ManiSkill's names.

A mode is data: which commands a robot's joint groups take. Unless a descriptor says otherwise in
`robots.RobotDescriptor.control_modes`, its groups of every mode are made of the relative ones of
its action split, with ManiSkill's numbers for a Panda.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi
from types import MappingProxyType
from typing import TYPE_CHECKING

from robots.action_split import ActionSplit, JointGroup, is_gripper
from robots.common.bounds import shown
from robots.common.errors import DescriptorError, UnknownNameError

if TYPE_CHECKING:
    from robots.descriptor import RobotDescriptor

# mani_skill 3.0.1, agents/robots/panda/panda.py
SPEED = 1.0  # rad/s or m/s, of an action number of 1
TCP_STEP = 0.1, 0.1  # m and rad per step
TCP_SPACE = 2.0, 2 * pi  # m and rad, of absolute poses


@dataclass(frozen=True)
class ControlMode:
    """What a mode asks of the joint groups that it changes.

    Attributes:
        command: See `robots.commands.COMMANDS`.
        delta: Whether positions or poses are relative.
        target: Whether they are relative to the last target, and not to where the robot is.
    """

    command: str
    delta: bool = False
    target: bool = False


MODES: Mapping[str, ControlMode] = MappingProxyType(
    {
        "pd_joint_delta_pos": ControlMode("position", delta=True),
        "pd_joint_pos": ControlMode("position"),
        "pd_joint_target_delta_pos": ControlMode("position", delta=True, target=True),
        "pd_joint_vel": ControlMode("velocity"),
        "pd_joint_pos_vel": ControlMode("position_velocity"),
        "pd_joint_delta_pos_vel": ControlMode("position_velocity", delta=True),
        "pd_ee_delta_pos": ControlMode("tcp_position", delta=True),
        "pd_ee_delta_pose": ControlMode("tcp_pose", delta=True),
        "pd_ee_pose": ControlMode("tcp_pose"),
        "pd_ee_target_delta_pos": ControlMode("tcp_position", delta=True, target=True),
        "pd_ee_target_delta_pose": ControlMode("tcp_pose", delta=True, target=True),
    }
)

CONTROL_MODES = tuple(MODES)  # ManiSkill's names


def modes_of(robot: RobotDescriptor) -> tuple[str, ...]:
    """Return the names of the modes that may be asked of a robot: ManiSkill's, then its own."""
    return (*CONTROL_MODES, *(name for name in robot.control_modes if name not in MODES))


def read_mode(text: str) -> str | dict[str, str]:
    """Return the control mode that a text names, or those by arm: ``left=pd_joint_pos,right=…``.

    Raises:
        DescriptorError: If it is neither.
    """
    if "=" not in text:
        return text
    pairs = [part.partition("=")[::2] for part in text.split(",")]
    names = [arm.strip() for arm, _ in pairs]
    if not all(arm.strip() and mode.strip() for arm, mode in pairs) or len(set(names)) < len(names):
        raise DescriptorError(
            f"control mode {shown(text)} makes no sense; a name such as {CONTROL_MODES[0]!r} is"
            " needed, or one for each arm: 'left=pd_ee_pose,right=pd_joint_pos'"
        )
    return {arm.strip(): mode.strip() for arm, mode in pairs}


def plain_mode(mode: str | Mapping[str, str]) -> str | dict[str, str]:
    """Return a control mode, or those by arm, as plain data."""
    return mode if isinstance(mode, str) else dict(mode)


def in_mode(robot: RobotDescriptor, mode: str | Mapping[str, str]) -> RobotDescriptor:
    """Return a robot with the actions of a control mode; see `RobotDescriptor.in_control_mode`."""
    parts = robot.parts or {robot.name: robot}
    chosen = dict.fromkeys(parts, mode) if isinstance(mode, str) else dict(mode)
    for name, own in chosen.items():
        if name not in parts:
            raise UnknownNameError(f"limb of {robot.name}", name, parts)
        if own not in modes_of(robot):
            raise UnknownNameError("control mode", own, modes_of(robot))
    changed: dict[str, JointGroup] = {}
    for name, own in chosen.items():
        if own != CONTROL_MODES[0] or own in robot.control_modes:
            limb = not robot.limbs or name in robot.limbs
            changed.update(_groups(robot, parts[name].action_split, own, limb=limb))
    if all(robot.action_split.groups[name] == group for name, group in changed.items()):
        return robot
    return replace(robot, action_split=robot.action_split.replace(**changed))


def check_modes(robot: RobotDescriptor) -> None:
    """Refuse modes of a robot's own that drive groups which it does not have.

    Raises:
        DescriptorError: If there are any.
    """
    for mode, groups in robot.control_modes.items():
        for name, group in groups.items():
            own = robot.action_split.groups.get(name)
            if own is None or own.joints != group.joints:
                raise DescriptorError(
                    f"{robot.name}: control mode {mode!r} drives {name!r} with joints"
                    f" {', '.join(group.joints)}; the action split has no such group"
                )


def _groups(
    robot: RobotDescriptor, split: ActionSplit, mode: str, *, limb: bool
) -> dict[str, JointGroup]:
    """Return the joint groups that a mode changes, of a robot or one of its parts.

    Args:
        robot: The robot.
        split: What the part drives.
        mode: Name of the mode.
        limb: Whether the part has a TCP.
    """
    own = {n: group for n, group in robot.control_modes.get(mode, {}).items() if n in split}
    if mode not in MODES:
        return own
    asked = MODES[mode]
    relative = {n: g for n, g in split.groups.items() if g.delta and n not in own}
    if asked.command == "position":
        return own | {name: _by_position(group, asked) for name, group in relative.items()}
    arms = {name: group for name, group in relative.items() if not is_gripper(name)}
    if asked.command.startswith("tcp"):
        if own or not limb:
            return own
        name = _arm(robot, list(arms), mode)
        return {name: _by_tcp(arms[name], asked)}
    if not arms and not own and limb:
        raise DescriptorError(
            f"{robot.name} has no joint group that {mode!r} could drive: none is relative in"
            f" {CONTROL_MODES[0]!r}, but for grippers"
        )
    return own | {name: _by_velocity(group, asked) for name, group in arms.items()}


def _arm(robot: RobotDescriptor, groups: Sequence[str], mode: str) -> str:
    """Return the group whose joints bring the TCP somewhere."""
    named = [name for name in groups if "arm" in name.split("_")]
    for choice in (groups, named):
        if len(choice) == 1:
            return choice[0]
    raise DescriptorError(
        f"{robot.name} cannot be driven in {mode!r}, which moves its TCP: of its joint groups,"
        f" {', '.join(robot.action_split)}, not one alone is its arm. Call one 'arm', or give it"
        f" control_modes={{{mode!r}: {{...}}}}"
    )


def _by_position(group: JointGroup, mode: ControlMode) -> JointGroup:
    return replace(group, target=mode.target) if mode.delta else group.by_position()


def _by_velocity(group: JointGroup, mode: ControlMode) -> JointGroup:
    speeds = ((-SPEED, SPEED),) * len(group.joints)
    if mode.command == "velocity":
        return replace(
            group,
            command=mode.command,
            **_range(speeds),
            stiffness=0.0,
            delta=False,
            normalised=True,
        )
    positions = group if mode.delta else group.by_position()
    return replace(positions, command=mode.command, **_range((*positions.ranges, *speeds)))


def _by_tcp(group: JointGroup, mode: ControlMode) -> JointGroup:
    moves, turns = TCP_STEP if mode.delta else TCP_SPACE
    sizes = (moves,) * 3 if mode.command == "tcp_position" else (moves,) * 3 + (turns,) * 3
    return replace(
        group,
        command=mode.command,
        **_range([(-size, size) for size in sizes]),
        delta=mode.delta,
        target=mode.target,
        normalised=mode.delta,
    )


def _range(pairs: Sequence[tuple[float, float]]) -> dict[str, tuple[float, ...]]:
    return {"lower": tuple(low for low, _ in pairs), "upper": tuple(high for _, high in pairs)}
