"""The links, joints and shapes of a robot, as its URDF gives them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robot_layouts.kinematics.rotations import Floats

# Attributes of each kind of shape, with how many numbers each has.
SIZES: Mapping[str, Mapping[str, int]] = {
    "box": {"size": 3},
    "sphere": {"radius": 1},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "mesh": {},
}


@dataclass(frozen=True, eq=False)
class UrdfShape:
    """A shape of a link.

    Attributes:
        kind: ``box``, ``sphere``, ``cylinder``, ``capsule`` or ``mesh``.
        sizes: Of a box its extents, of a sphere its radius, of a cylinder and a capsule radius
            and length (m); of a mesh the scale along x, y and z.
        file: Of a mesh what the URDF refers to, else empty.
        origin: Its pose in the link's frame, (4, 4) (m).
        where: The URDF and the link, for messages.
    """

    kind: str
    sizes: tuple[float, ...]
    file: str
    origin: Floats
    where: str


@dataclass(frozen=True, eq=False)
class LinkInertia:
    """What a link weighs.

    Attributes:
        mass: kg; 0 where it follows from the collision shapes.
        origin: Pose of the frame at the centre of mass in the link's, (4, 4) (m).
        tensor: Inertia in that frame, (3, 3) (kg·m²).
    """

    mass: float
    origin: Floats
    tensor: Floats


@dataclass(frozen=True, eq=False)
class ModelJoint:
    """A joint of any type.

    Attributes:
        name: Joint name.
        type: ``revolute``, ``continuous``, ``prismatic``, ``fixed``, …
        parent: Link that carries it.
        child: Link that it carries.
        origin: Pose of the joint in the parent link's frame, (4, 4) (m).
        axis: Axis of motion in the joint's frame, of length 1.
        lower: Lower limit (rad or m), or None if it has none.
        upper: Upper limit (rad or m), or None if it has none.
        effort: Largest effort (N·m or N), or None.
        velocity: Largest speed (rad/s or m/s), or None.
        mimics: Joint that it follows, or None.
        multiplier: Factor from that joint's position to this one's.
        offset: Added to it (rad or m).
    """

    name: str
    type: str
    parent: str
    child: str
    origin: Floats
    axis: tuple[float, float, float]
    lower: float | None
    upper: float | None
    effort: float | None
    velocity: float | None
    mimics: str | None
    multiplier: float = 1.0
    offset: float = 0.0

    @property
    def moves(self) -> bool:
        """Whether it is not fixed."""
        return self.type != "fixed"

    @property
    def unit(self) -> str:
        """``m`` for a prismatic joint, else ``rad``."""
        return "m" if self.type == "prismatic" else "rad"

    @property
    def span(self) -> tuple[float, float]:
        """Its limits, or one turn each way if it has none (rad or m)."""
        if self.lower is None or self.upper is None:
            return (-2 * math.pi, 2 * math.pi)
        return (self.lower, self.upper)


@dataclass(frozen=True, eq=False)
class UrdfModel:
    """The tree of links and joints.

    Attributes:
        name: The robot's name in the URDF.
        links: Link names, in the URDF's order.
        joints: Joints, in the URDF's order.
        collisions: What each link collides with; links that collide with nothing are left out.
        visuals: What each link looks like; links that are not drawn are left out.
        inertials: What each link weighs; links that do not say are left out.
    """

    name: str
    links: tuple[str, ...]
    joints: tuple[ModelJoint, ...]
    collisions: Mapping[str, tuple[UrdfShape, ...]] = field(default_factory=dict)
    visuals: Mapping[str, tuple[UrdfShape, ...]] = field(default_factory=dict)
    inertials: Mapping[str, LinkInertia] = field(default_factory=dict)

    @cached_property
    def parent_joint(self) -> dict[str, ModelJoint]:
        """The joint that carries each link but the root."""
        return {joint.child: joint for joint in self.joints}

    @cached_property
    def root(self) -> str:
        """The link that no joint carries."""
        return next(link for link in self.links if link not in self.parent_joint)

    @cached_property
    def moving(self) -> tuple[ModelJoint, ...]:
        """Joints that are not fixed."""
        return tuple(joint for joint in self.joints if joint.moves)

    @cached_property
    def _carried(self) -> dict[str, list[ModelJoint]]:
        carried: dict[str, list[ModelJoint]] = {link: [] for link in self.links}
        for joint in self.joints:
            carried[joint.parent].append(joint)
        return carried

    @cached_property
    def ordered(self) -> tuple[ModelJoint, ...]:
        """All joints, depth first from the root: each after the one that carries its parent."""
        found: list[ModelJoint] = []
        waiting = self._carried[self.root][::-1]
        while waiting:
            found.append(waiting.pop())
            waiting += self._carried[found[-1].child][::-1]
        return tuple(found)

    @cached_property
    def depths(self) -> dict[str, int]:
        """For each joint that moves, how many moving joints the longest chain from it on has."""
        behind = dict.fromkeys(self.links, 0)  # of what hangs on each link
        depths: dict[str, int] = {}
        for joint in reversed(self.ordered):
            depth = behind[joint.child] + joint.moves
            behind[joint.parent] = max(behind[joint.parent], depth)
            if joint.moves:
                depths[joint.name] = depth
        return depths

    def rigid_with(self, link: str) -> tuple[str, ...]:
        """Return a link and all that hangs on it by fixed joints, nearest first."""
        found = [link]
        for near in found:
            found += [joint.child for joint in self._carried.get(near, ()) if not joint.moves]
        return tuple(found)

    def moving_on(self, link: str) -> tuple[ModelJoint, ...]:
        """Return the moving joints that are carried by a link or what is rigid with it."""
        rigid = set(self.rigid_with(link))
        return tuple(joint for joint in self.moving if joint.parent in rigid)

    def path_to(self, link: str) -> tuple[ModelJoint, ...]:
        """Return the joints from the root to a link."""
        path: list[ModelJoint] = []
        while link in self.parent_joint:
            path.append(self.parent_joint[link])
            link = path[-1].parent
        return tuple(reversed(path))

    def below(self, joint: ModelJoint) -> tuple[ModelJoint, ...]:
        """Return a moving joint and all moving joints behind it."""
        found = [joint]
        for near in found:
            found += self.moving_on(near.child)
        return tuple(found)
