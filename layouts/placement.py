"""One robot's place in a layout: where its base is fixed, and how it starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import TYPE_CHECKING

from layouts.frames import ORIGIN, Pose, check_pose, declared_quaternion
from robot_layouts.core.bounds import FAR, as_float, checked_numbers, shown
from robot_layouts.kinematics.quaternions import inverted, multiplied, normalised
from robots import CONTROL_MODES, LayoutError, RobotDescriptor
from robots.control_modes import read_mode, written_mode
from robots.descriptor import IDENTITY, Quaternion, Vector3
from robots.named import named_robot

RobotLike = str | PathLike[str] | RobotDescriptor

LARGEST_NOISE = 1.0  # rad; of twice that, a joint starts anywhere


@dataclass(frozen=True)
class Placement:
    """One robot's place: where its base is fixed, and the joint positions it starts from.

    A place is in the world, or hangs ``on`` a frame or another robot's base of the same layout.
    What is left out is the robot's own `robots.Home`, so that another robot can take the place.

    Attributes:
        robot: Its descriptor; a registry name, the path of a URDF or MJCF, or ``MODULE:NAME`` is
            accepted and looked up.
        position: Base position (m) in the world or in what it hangs on. None is the robot's home
            in the world, and the origin of what it hangs on.
        quaternion: Base orientation there, wxyz, unit length, or None for home.
        keyframe: Keyframe it starts from, or None for home.
        qpos_noise: Standard deviation of the joint noise added at a reset (rad), 0 … 1.
        rpy: Base orientation as roll, pitch and yaw (rad, about fixed x, y, z as in a URDF),
            instead of a quaternion.
        on: Name of the frame or robot it hangs on; None is the world.
        control_mode: What its action numbers mean, one of `robots.CONTROL_MODES` or of its own;
            or those of its limbs, as ``"left=pd_ee_pose,right=pd_joint_pos"`` or a mapping, which
            is kept as such a text. None is the task's. The robot stays as it was declared; see
            `Layout.in_control_mode`.
        qpos: Joint positions that it starts from, in the order of the robot's joints (rad, m),
            instead of a keyframe's.
    """

    robot: RobotDescriptor
    position: Vector3 | None = None
    quaternion: Quaternion | None = None
    keyframe: str | None = None
    qpos_noise: float = 0.02
    rpy: Vector3 | None = field(default=None, kw_only=True)
    on: str | None = field(default=None, kw_only=True)
    control_mode: str | None = field(default=None, kw_only=True)
    qpos: tuple[float, ...] | None = field(default=None, kw_only=True)
    _world: Pose | None = field(default=None, init=False, repr=False, compare=False)

    if TYPE_CHECKING:  # a robot may be named; what is kept is its descriptor

        def __init__(
            self,
            robot: RobotLike,
            position: Vector3 | None = None,
            quaternion: Quaternion | None = None,
            keyframe: str | None = None,
            qpos_noise: float = 0.02,
            *,
            rpy: Vector3 | None = None,
            on: str | None = None,
            control_mode: str | Mapping[str, str] | None = None,
            qpos: Sequence[float] | None = None,
        ) -> None:
            """Take a place."""

    def __post_init__(self) -> None:
        """Look a robot's name up, and refuse poses that are no poses."""
        object.__setattr__(self, "robot", load_robot(self.robot))
        check_pose(self)
        if self.keyframe is not None:
            if not isinstance(self.keyframe, str):
                raise LayoutError(f"keyframe is {shown(self.keyframe)}; it takes a keyframe's name")
            self.robot.keyframe(self.keyframe)
        if self.qpos is not None:
            object.__setattr__(self, "qpos", _checked_qpos(self))
        noise = as_float(self.qpos_noise)
        if noise is None or not 0 <= noise <= LARGEST_NOISE:
            raise LayoutError(
                f"qpos_noise is {shown(self.qpos_noise)} rad; it must be 0 or more,"
                f" {LARGEST_NOISE:g} at most"
            )
        object.__setattr__(self, "qpos_noise", noise)
        if self.control_mode is not None:
            object.__setattr__(self, "control_mode", _checked_mode(self.robot, self.control_mode))

    @property
    def own_modes(self) -> dict[str, str]:
        """The control mode that the place says, by limb; that of the whole robot at ``""``."""
        if self.control_mode is None:
            return {}
        mode = read_mode(self.control_mode)
        return {"": mode} if isinstance(mode, str) else mode

    @property
    def local_pose(self) -> Pose:
        """Base pose in the frame it hangs on, or in the world."""
        if self.position is not None:
            position = self.position
        else:
            position = self.robot.home.position if self.on is None else ORIGIN
        return Pose(position, declared_quaternion(self, self.robot.home.quaternion))

    @property
    def base_pose(self) -> Pose:
        """Base pose in the world.

        Raises:
            LayoutError: If it hangs on something, and is not in a layout that knows what.
        """
        if self.on is None:
            return self.local_pose
        if self._world is None:
            raise LayoutError(
                f"this placement hangs on {self.on!r}; only a layout that holds both knows where"
                " that is"
            )
        return self._world

    @property
    def base_position(self) -> Vector3:
        """Base position in the world (m)."""
        return self.base_pose.position

    @property
    def base_quaternion(self) -> Quaternion:
        """Base orientation in the world, wxyz."""
        return self.base_pose.quaternion

    @property
    def facing(self) -> Quaternion:
        """How the robot is turned from its home (wxyz), where it reaches out along +x."""
        return _without(self.robot.home.quaternion, self.base_quaternion)

    @property
    def start_keyframe(self) -> str | None:
        """Name of the keyframe the robot starts from; None if it starts from ``qpos``."""
        if self.qpos is not None:
            return None
        return self.robot.home.keyframe if self.keyframe is None else self.keyframe

    @property
    def start_qpos(self) -> tuple[float, ...]:
        """Joint positions it starts from, in the order of the robot's joints (rad, m)."""
        start = self.start_keyframe
        return self.robot.keyframe(start) if start else self.qpos or ()

    @property
    def parts(self) -> dict[str, Placement]:
        """The robot's limbs, and what it drives besides, each placed where it begins; or nothing.

        They are in the world, whatever the robot hangs on.
        """
        pose = self.base_pose
        parts: dict[str, Placement] = {}
        for name, part in self.robot.parts.items():
            limb = self.robot.limbs.get(name)
            base = pose if limb is None else pose.then(Pose(limb.base, IDENTITY))
            parts[name] = replace(
                self,
                robot=part,
                position=base.position,
                quaternion=base.quaternion,
                rpy=None,
                on=None,
                control_mode=None,
                qpos=self.qpos and [self.qpos[self.robot.joints.index(j)] for j in part.joints],
            )
        return parts

    def with_robot(self, robot: RobotLike) -> Placement:
        """Return the placement with another robot, which faces the same way.

        One of other joints starts from its home's keyframe instead of ``qpos``.

        Raises:
            UnknownNameError: If there is no such robot, or it lacks the keyframe.
        """
        robot = load_robot(robot)
        qpos = self.qpos if self.qpos and robot.joints == self.robot.joints else None
        before, after = self.robot.home.quaternion, robot.home.quaternion
        if before == after or (self.quaternion is None and self.rpy is None):
            return replace(self, robot=robot, qpos=qpos)
        turn = _without(before, self.local_pose.quaternion)
        return replace(self, robot=robot, rpy=None, quaternion=faced(robot, turn), qpos=qpos)


def faced(robot: RobotDescriptor, turn: Quaternion) -> Quaternion:
    """Return the base orientation (wxyz) of a robot that is turned from its home by ``turn``."""
    if robot.home.quaternion == IDENTITY:
        return turn
    return normalised(multiplied(turn, robot.home.quaternion))


def load_robot(robot: RobotLike) -> RobotDescriptor:
    """Return a descriptor as it is, or the robot of a word; see `robots.named.named_robot`.

    Raises:
        LayoutError: If it is none of these.
        UnknownNameError: If no robot has that name.
        AssetError: If it is the path of no usable URDF or MJCF.
        DescriptorError: If it is ``MODULE:NAME``, and there is no such robot.
    """
    if isinstance(robot, RobotDescriptor):
        return robot
    if not isinstance(robot, (str, PathLike)):
        raise LayoutError(f"robot is {shown(robot)}; it takes a robot's name or a RobotDescriptor")
    return named_robot(robot)


def load_robots(
    robots: Mapping[str, RobotLike], what: str = "a layout", count: int | None = None
) -> dict[str, RobotDescriptor]:
    """Return the descriptors of robots by their places; see `load_robot`.

    Args:
        robots: Robot by place.
        what: What places them, for messages.
        count: How many it places; None is one or more.

    Raises:
        LayoutError: If this is no mapping from places to robots, or not of that many.
    """
    if not isinstance(robots, Mapping):
        raise LayoutError(
            f"robots is {shown(robots)}; it takes a mapping from each robot's place to its robot:"
            " {'left': 'panda', 'right': 'panda'}"
        )
    if count is not None and len(robots) != count:
        raise LayoutError(
            f"{what} places {count} robot{'s' * (count > 1)}; {len(robots)} given: {list(robots)}"
        )
    if not robots:
        raise LayoutError(f"{what} needs at least one robot")
    return {name: load_robot(robot) for name, robot in robots.items()}


def placed(placement: Placement, world: Pose) -> Placement:
    """Return a placement that knows where it is, if it hangs.

    Args:
        placement: As it was declared.
        world: Its base pose in the world.
    """
    if placement.on is None:
        return placement
    hung = replace(placement)
    object.__setattr__(hung, "_world", world)
    return hung


def _checked_qpos(placement: Placement) -> tuple[float, ...]:
    """Return where joints start (rad, m).

    Raises:
        LayoutError: If it is no number for each joint, or a keyframe is given, too.
    """
    robot = placement.robot
    if placement.keyframe is not None:
        raise LayoutError(
            f"qpos and keyframe {placement.keyframe!r} are given; a robot starts from one of them"
        )
    what = f"qpos of {robot.name}, which has {robot.dof} joints,"
    return checked_numbers(what, placement.qpos, robot.dof, FAR, LayoutError, "rad, m")


def _checked_mode(robot: RobotDescriptor, mode: object) -> str | None:
    """Return a control mode, or those of limbs, as one text; None if there are none.

    Raises:
        LayoutError: If it is not a control mode, or a mapping of limbs to control modes.
        UnknownNameError: If the robot has no such mode, or no such limb.
        DescriptorError: If the robot lacks what the mode needs.
    """
    if not isinstance(mode, (str, Mapping)):
        raise LayoutError(
            f"control_mode is {shown(mode)}; it takes a mode's name, such as {CONTROL_MODES[0]!r},"
            " or a mapping from limbs to modes"
        )
    asked = read_mode(mode) if isinstance(mode, str) else dict(mode)
    robot.in_control_mode(asked)
    if isinstance(asked, str):
        return asked
    return (written_mode(asked) if robot.parts else next(iter(asked.values()), None)) or None


def _without(home: Quaternion, quaternion: Quaternion) -> Quaternion:
    """Return what turns a robot from its home orientation to ``quaternion`` (both wxyz)."""
    return quaternion if home == IDENTITY else multiplied(quaternion, inverted(home))
