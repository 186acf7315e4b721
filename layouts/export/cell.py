"""What every format asks of a layout: links, joints, masses, drives and poses of its robots."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from layouts.arrangement import Arrangement
from layouts.export.files import Names
from layouts.frames import TABLE_DEPTH, table_outlines
from layouts.placement import Placement
from robot_layouts.core.commands import notice
from robot_layouts.kinematics.rotations import Floats, inverse_pose, pose_matrix, transform
from robots import AssetError, RobotDescriptor
from robots.bodies.allowed import LinkPair, read_allowed_pairs
from robots.urdf.model import LinkInertia, ModelJoint, UrdfModel
from robots.urdf.reading import model_of
from robots.urdf.summary import root_of
from robots.urdf.tcp import find_tcp
from robots.urdf.text import numbers_of
from robots.urdf.tree import kinematic_tree

BODIES = "bodies"  # what the files of a task's bodies are called, and no robot's
SMALLEST_INERTIA = 1e-6  # kg, kg·m²; of links that move and have none, as SAPIEN takes it


@dataclass(frozen=True)
class JointDrive:
    """How the descriptor drives a joint; see `robots.JointGroup` for the units.

    Attributes:
        stiffness: Of the spring.
        damping: Of the damper.
        force: The largest force.
        armature: Inertia of motor and gear.
        friction: PhysX's coefficient.
    """

    stiffness: float
    damping: float
    force: float
    armature: float
    friction: float


@dataclass(frozen=True, eq=False)
class RobotSource:
    """A robot's description and files, read once for all its places.

    Attributes:
        robot: Its descriptor.
        name: What its files are called in an export.
        urdf: Its URDF.
        root: The ``<robot>`` of that, repaired where it is clear how.
        model: What it describes.
        drawn: Whether the files that it is drawn by are there.
    """

    robot: RobotDescriptor
    name: str
    urdf: Path
    root: Element
    model: UrdfModel
    drawn: bool

    @cached_property
    def inertials(self) -> dict[str, LinkInertia]:
        """Masses and inertias by link, along its axes; those that shapes give are left out."""
        found: dict[str, LinkInertia] = {}
        moved = {joint.child for joint in self.model.moving}
        for link in self.model.links:
            own = self.model.inertials.get(link)
            if own is not None and own.mass != 0 and np.diag(own.tensor).any():
                origin, turn = np.eye(4), own.origin[:3, :3]
                origin[:3, 3] = own.origin[:3, 3]
                found[link] = LinkInertia(own.mass, origin, turn @ own.tensor @ turn.T)
            elif link in moved and link not in self.model.collisions:
                tensor = SMALLEST_INERTIA * np.eye(3)
                found[link] = LinkInertia(SMALLEST_INERTIA, np.eye(4), tensor)
        return found

    @cached_property
    def dynamics(self) -> dict[str, tuple[float, float]]:
        """Damping and friction that the URDF gives joints (N·m·s/rad and N·m, N·s/m and N)."""
        found: dict[str, tuple[float, float]] = {}
        for joint in self.root.iterfind("joint"):
            part = joint.find("dynamics")
            if part is not None:
                damping, friction = (
                    max(0.0, numbers_of(part, key, (0.0,), str(self.urdf))[0])
                    for key in ("damping", "friction")
                )
                found[joint.get("name", "")] = (damping, friction)
        return found

    @cached_property
    def drives(self) -> dict[str, JointDrive]:
        """Drives by joint, in the descriptor's order."""
        return {
            joint: JointDrive(*drive, armature, group.friction)
            for group in self.robot.action_split.groups.values()
            for joint, drive, armature in zip(
                group.joints, group.drives, group.armatures, strict=True
            )
        }

    @cached_property
    def allowed(self) -> frozenset[LinkPair]:
        """Pairs of links with shapes whose contacts do not count; see `robots.bodies.allowed`."""
        pairs = read_allowed_pairs(self.robot, self.model, self.urdf)
        return frozenset(pair for pair in pairs if pair <= self.model.collisions.keys())

    @property
    def followers(self) -> tuple[ModelJoint, ...]:
        """Joints that follow another one, by the URDF."""
        return tuple(joint for joint in self.model.moving if joint.mimics is not None)

    @property
    def leaders(self) -> tuple[str, ...]:
        """Joints that the descriptor drives and that follow none, in its order."""
        following = {joint.name for joint in self.followers}
        return tuple(joint for joint in self.robot.joints if joint not in following)

    def friction_of(self, link: str) -> tuple[float, float] | None:
        """Return static and dynamic friction of a link's surface, if the descriptor has them."""
        material = self.robot.gripper_material
        if material is None or link not in material.links:
            return None
        return material.static_friction, material.dynamic_friction


@dataclass(frozen=True, eq=False)
class Standing:
    """A robot in its place.

    Attributes:
        place: The place's name.
        placement: Where it stands.
        source: Its description.
        start: Positions of its joints, in the descriptor's order (rad, m).
    """

    place: str
    placement: Placement
    source: RobotSource
    start: Sequence[float]

    @cached_property
    def base(self) -> Floats:
        """Pose of the root link in the world, (4, 4) (m)."""
        return pose_matrix(self.placement.base_position, self.placement.base_quaternion)

    @cached_property
    def home(self) -> dict[str, float]:
        """Position of every joint that moves at the start (rad, m)."""
        robot, model = self.placement.robot, self.source.model
        home = dict(zip(robot.joints, self.start, strict=True))
        waiting = list(self.source.followers)
        while waiting:
            joint = waiting.pop(0)
            following = {other.name for other in waiting}
            if joint.mimics in following:
                waiting.append(joint)
            else:
                home[joint.name] = joint.multiplier * home[joint.mimics or ""] + joint.offset
        return {joint.name: home[joint.name] for joint in model.moving}

    @cached_property
    def poses(self) -> dict[str, Floats]:
        """Pose of every link in the world at `home`, (4, 4) (m)."""
        tree = kinematic_tree(self.source.model)
        qpos = np.array([[self.home[joint] for joint in tree.coordinates]])
        return dict(zip(tree.links, self.base @ tree.forward(qpos)[0], strict=True))


@dataclass(frozen=True, eq=False)
class ToolPoint:
    """A tool centre point, fixed to the link that orients it where it is at home.

    Attributes:
        arm: The arm's name: a place, or ``place.limb``.
        place: The robot's place.
        link: The link.
        position: In the link's frame, (3,) (m).
    """

    arm: str
    place: str
    link: str
    position: Floats


@dataclass(frozen=True, eq=False)
class ExportedCell:
    """A layout, with all that an export reads of its robots' files.

    Attributes:
        layout: The layout.
        robots: The robots, by place.
    """

    layout: Arrangement
    robots: Mapping[str, Standing]

    @classmethod
    def read(
        cls,
        layout: Arrangement,
        *,
        visuals: bool,
        starts: Mapping[str, Sequence[float]] | None = None,
    ) -> ExportedCell:
        """Read the robots' files.

        Args:
            layout: The layout.
            visuals: Whether the files that only pictures need are wanted, too. A robot without
                them is drawn by its collision shapes; a notice says so.
            starts: Where robots are, by place, in the order of their joints (rad, m); None is
                where the layout starts them.

        Raises:
            AssetError: If a robot's files cannot be found or are invalid.
            DescriptorError: If a descriptor contradicts its URDF.
        """
        sources: dict[RobotDescriptor, RobotSource] = {}
        names = Names()
        names.new(BODIES)
        for placement in layout.values():
            robot = placement.robot
            if robot not in sources:
                name = names.new(robot.name)
                sources[robot] = _source(robot, name, visuals=visuals)
        robots = {
            name: Standing(name, placement, sources[placement.robot], start)
            for name, placement in layout.items()
            for start in [placement.start_qpos if starts is None else starts[name]]
        }
        return cls(layout, robots)

    @property
    def sources(self) -> tuple[RobotSource, ...]:
        """What the robots are, each once."""
        return tuple({id(robot.source): robot.source for robot in self.robots.values()}.values())

    @property
    def tools(self) -> Iterator[ToolPoint]:
        """The tool centre points of all arms, in their order."""
        for arm, part in self.layout.arms.items():
            place = self.layout.owner(arm)
            standing = self.robots[place]
            tree = kinematic_tree(standing.source.model)
            tcp = find_tcp(part.robot, tree)
            poses = np.array([[standing.poses[link] for link in tree.links]])
            turned = poses[0, tcp.turned]
            position = transform(inverse_pose(turned), tcp.places(poses)[0])
            yield ToolPoint(arm, place, tree.links[tcp.turned], position)

    @property
    def tables(self) -> dict[str, tuple[Floats, Floats]]:
        """Tables as solid boxes: pose of the middle, (4, 4), and size, (3,) (m), by name."""
        frames, found = self.layout.frame_poses, dict[str, tuple[Floats, Floats]]()
        for name in table_outlines(frames):
            pose = frames[name]
            edges = (frames[f"{name}.{edge}"] for edge in ("east", "west", "north", "south"))
            east, west, north, south = (np.array(edge.position) for edge in edges)
            middle = pose_matrix(pose.position, pose.quaternion)
            width, depth = np.linalg.norm(east - west), np.linalg.norm(north - south)
            size = np.array([width, depth, TABLE_DEPTH])
            middle[:3, 3] -= middle[:3, 2] * TABLE_DEPTH / 2
            found[name] = (middle, size)
        return found


def _source(robot: RobotDescriptor, name: str, *, visuals: bool) -> RobotSource:
    drawn = visuals
    try:
        urdf = robot.urdf.locate(pictures=visuals)
    except AssetError as error:
        if not visuals:
            raise
        urdf, drawn = robot.urdf.locate(), False
        notice(f"{robot.name} is drawn by its collision shapes: {error}")
    model = model_of(urdf)
    kinematic_tree(model, robot.joints)  # refuses a descriptor that contradicts its URDF
    return RobotSource(robot, name, urdf, root_of(urdf), model, drawn)
