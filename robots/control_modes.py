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

from robot_layouts.core.bounds import shown
from robot_layouts.core.errors import DescriptorError
from robots.action_split import ActionSplit, JointGroup, is_gripper

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
            f"control mode {shown(text)} is invalid; a name such as {CONTROL_MODES[0]!r} is"
            " needed, or one for each arm: 'left=pd_ee_pose,right=pd_joint_pos'"
        )
    return {arm.strip(): mode.strip() for arm, mode in pairs}


def written_mode(modes: Mapping[str, str]) -> str:
    """Return control modes by arm as the text that `read_mode` reads."""
    return ",".join(f"{arm}={mode}" for arm, mode in modes.items())


def plain_mode(mode: str | Mapping[str, str]) -> str | dict[str, str]:
    """Return a control mode, or those by arm, as plain data."""
    return mode if isinstance(mode, str) else dict(mode)


def driven_in(
    mode: str, split: ActionSplit, own: Mapping[str, JointGroup], *, has_tcp: bool = True
) -> dict[str, JointGroup]:
    """Return the joint groups that a control mode changes, of a robot or one of its limbs.

    Args:
        mode: Name of the mode.
        split: What the robot or limb drives, as declared.
        own: Groups that the robot drives in a way of its own in this mode.
        has_tcp: Whether there is a TCP to move.

    Raises:
        DescriptorError: If what the mode needs is missing: joint limits, or an arm.
    """
    changed = {name: group for name, group in own.items() if name in split}
    if mode == CONTROL_MODES[0] or mode not in MODES:
        return changed
    asked = MODES[mode]
    relative = {n: g for n, g in split.groups.items() if g.delta and n not in own}
    if asked.command == "position":
        return changed | {name: _by_position(group, asked) for name, group in relative.items()}
    arms = {name: group for name, group in relative.items() if not is_gripper(name)}
    if asked.command in ("velocity", "position_velocity"):
        if not arms and not changed and has_tcp:
            raise DescriptorError(
                f"there is no joint group that {mode!r} could drive: but for grippers, none is"
                f" relative in {CONTROL_MODES[0]!r}"
            )
        return changed | {name: _by_velocity(group, asked) for name, group in arms.items()}
    if any(group.asks.tcp for group in changed.values()) or not has_tcp:
        return changed
    arm = _arm(mode, split, list(arms))
    return changed | {arm: _by_tcp(arms[arm], asked)}


def _arm(mode: str, split: ActionSplit, groups: Sequence[str]) -> str:
    """Return the group whose joints bring the TCP somewhere."""
    named = [name for name in groups if "arm" in name.split("_")]
    turning = [name for name in named if name.split("_")[-1] == "arm"]  # not left_arm_slide
    for choice in (groups, named, turning):
        if len(choice) == 1:
            return choice[0]
    raise DescriptorError(
        f"{mode!r} moves the TCP, and of the joint groups {', '.join(split)} not one alone is the"
        f" arm. Call one 'arm', or say it in control_modes={{{mode!r}: {{...}}}}"
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
