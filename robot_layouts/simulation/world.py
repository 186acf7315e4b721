"""What a task puts into a world, as plain data that a backend builds; the table of ManiSkill's."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import cos, isfinite, pi, sin
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from objects.colliding import built_of
from objects.joints import Joint, checked_joints
from objects.shapes import Box, Floor, Mesh, Plane, Shape, scaled
from robot_layouts.core.bounds import checked_choice, expect_unit, shown
from robot_layouts.simulation.physics import SAPIEN_DEFAULTS, PhysicsSettings
from robots import SimulationError, UnknownNameError
from robots.assets.locator import GROUND_TEXTURE, TABLE
from robots.descriptor import IDENTITY, Quaternion, Vector3

# mani_skill 3.0.1, utils/scene_builder/table/scene_builder.py (m)
TABLE_HEIGHT = 0.9196429
TABLE_HALF_SIZE = (2.418 / 2, 1.209 / 2, TABLE_HEIGHT / 2)
TABLE_POSITION = (-0.12, 0.0, -TABLE_HEIGHT)
TABLE_QUATERNION = (cos(pi / 4), 0.0, 0.0, sin(pi / 4))  # the long side along y
TABLE_OUTLINE = (  # x_min, y_min, x_max, y_max (m)
    TABLE_POSITION[0] - TABLE_HALF_SIZE[1],
    -TABLE_HALF_SIZE[0],
    TABLE_POSITION[0] + TABLE_HALF_SIZE[1],
    TABLE_HALF_SIZE[0],
)
GROUND_HEIGHT = -(3.5762787e-07 + 0.91964257)  # from the table mesh's bounding box
TABLE_MESH_SCALE = 1.75
WHITE = (1.0, 1.0, 1.0, 1.0)


class Part(NamedTuple):
    """A link of a robot, or a body of its own.

    Attributes:
        robot: The robot's name in the layout, or None.
        name: Name of the link or the body.
    """

    robot: str | None
    name: str

    def __str__(self) -> str:
        """Return ``robot.link``, or the body's name."""
        return self.name if self.robot is None else f"{self.robot}.{self.name}"


BodyKind = Literal["dynamic", "kinematic", "static"]
_KINDS = get_args(BodyKind)

Visuals = bool | Literal["light"]
"""Whether what pictures need is built; if \"light\", robots with meshes of fewer triangles."""


@dataclass(frozen=True)
class WorldBody:
    """A body that a task puts into the world.

    Attributes:
        name: Its name, also in the state dict.
        shapes: What it is made of, in its own frame.
        kind: Whether physics, only the task, or nothing moves it.
        position: Where it is built (m, world).
        quaternion: How it is turned there, wxyz.
        anchored: Whether every reset puts it back there.
        marker: Whether it is there for people only: cameras that observe do not see it.
        scale: Factor by which it varies in size; wherever the task puts it, its lowest point is
            where that of the body without it would be.
        size: Factor by which ``shapes`` are larger than the task declared them, with ``scale``.
        joints: What moves parts of it; each part is a body of the world, too, ``NAME.JOINT``.
        part_of: The body whose joint moves it; None of those that are no such part.
    """

    name: str
    shapes: tuple[Shape, ...]
    kind: BodyKind = "dynamic"
    position: Vector3 = (0.0, 0.0, 0.0)
    quaternion: Quaternion = IDENTITY
    anchored: bool = False
    marker: bool = False
    scale: float = field(default=1.0, repr=False)
    size: float = field(default=1.0, repr=False)
    joints: tuple[Joint, ...] = field(default=(), repr=False)
    part_of: str | None = field(default=None, repr=False)


def part_name(body: str, joint: str) -> str:
    """Return the name of the body that a joint of another body moves."""
    return f"{body}.{joint}"


@dataclass
class Placements:
    """What is to be placed, in any number of worlds at once.

    Attributes:
        bodies: By name, then by world: position (m) and quaternion (wxyz), seven numbers.
        robots: Likewise: joint positions in the descriptor's order, (dof,) (rad, m).
        joints: By body, then by world: positions of joints by name (m, rad).
    """

    bodies: dict[str, dict[int, list[float]]] = field(default_factory=dict)
    robots: dict[str, dict[int, NDArray[np.float64]]] = field(default_factory=dict)
    joints: dict[str, dict[int, dict[str, float]]] = field(default_factory=dict)

    def __bool__(self) -> bool:
        """Tell whether there is anything to place."""
        return bool(self.bodies or self.robots or self.joints)

    def clear(self) -> None:
        """Forget all of it."""
        for placed in (self.bodies, self.robots, self.joints):
            placed.clear()

    def forget(self, env_ids: Iterable[int]) -> None:
        """Leave out what was meant for some worlds."""
        for env in env_ids:
            for rows in (*self.bodies.values(), *self.robots.values(), *self.joints.values()):
                rows.pop(env, None)


class World:
    """Robots first, in the layout's order, then bodies in the order in which they are added.

    The order of dynamic bodies decides the order in which PhysX solves contacts, so it is part of
    what a task declares.

    What is placed takes effect, in all worlds in one go, before a simulation next steps or is read.

    Attributes:
        layout: Which robots stand where.
        physics: Settings it is built with.
        visuals: Whether what pictures need is built, and which meshes.
        bodies: Body by name.
        design: Geometry drawn for the coming episodes, if the task draws any.
        size: Factor on the size of all bodies that are added.
        scales: Another one by body; 1 for those that are left out.
        links_pass: Whether links of two robots pass through each other where the robots' files let
            them pass through some of their own, as in ManiSkill; else robots always collide.
        shadows: Whether the first light casts shadows in pictures.
    """

    def __init__(
        self,
        layout: Layout,
        physics: PhysicsSettings | None = None,
        *,
        visuals: Visuals = False,
        number: int = 0,
        placements: Placements | None = None,
        links_pass: bool = False,
        shadows: bool = False,
    ) -> None:
        """Begin without bodies.

        Args:
            layout: Which robots stand where.
            physics: Solver settings; None keeps SAPIEN's own defaults.
            visuals: Whether to build what pictures need (a Vulkan driver must be present).
            number: Its number among the worlds of a simulation.
            placements: Where that simulation looks for what is placed.
            links_pass: See the attribute.
            shadows: See the attribute.
        """
        self.layout = layout
        self.physics = SAPIEN_DEFAULTS if physics is None else physics
        self.visuals: Visuals = visuals
        self.bodies: dict[str, WorldBody] = {}
        self.design: Any = None
        self.size = 1.0
        self.scales: Mapping[str, float] = {}
        self.links_pass = links_pass
        self.shadows = shadows
        self._number = number
        self._placements = Placements() if placements is None else placements

    @property
    def whole(self) -> World:
        """The world itself, of one that is seen in another frame."""
        return self

    def add(
        self,
        name: str,
        *shapes: Shape,
        kind: BodyKind = "dynamic",
        position: Vector3 = (0.0, 0.0, 0.0),
        quaternion: Quaternion = IDENTITY,
        anchored: bool = False,
        marker: bool = False,
        joints: Sequence[Joint] = (),
    ) -> WorldBody:
        """Add a body made of shapes, and the parts that its joints move.

        Args:
            name: A name no other body of this world has.
            shapes: Its shapes, in the body's frame.
            kind: ``"dynamic"`` moves by physics, ``"kinematic"`` by the task, ``"static"`` never.
            position: Where it is built (m, world).
            quaternion: How it is turned, wxyz.
            anchored: Whether every reset puts it back there.
            marker: Whether it is there for people only: cameras that observe do not see it.
            joints: What moves parts of it, each after the one that carries it. A body that is not
                dynamic is held in the world; its parts move all the same.

        Raises:
            SimulationError: If the name is taken, or something is not what it must be.
            AssetError: If the file of a mesh that collides is missing or cannot be read.
            DescriptorError: If two joints have the same name.
            UnknownNameError: If a joint is carried by none of those before it.
        """
        self._check_body(name, shapes, kind)
        joints = checked_joints(f"body {name!r}", joints) if joints else ()
        if name in self.bodies:
            raise SimulationError(f"this world already has a body called {name!r}")
        self._pose(name, position, quaternion)
        scale = self.scales.get(name, 1.0)
        if (size := scale * self.size) != 1.0:
            shapes = tuple(scaled(shape, size) for shape in shapes)
            joints = tuple(joint.scaled(size) for joint in joints)
        moves = kind == "dynamic" or bool(joints)
        shapes = self._built(name, shapes, moves=moves)
        joints = tuple(
            replace(joint, parts=self._built(part_name(name, joint.name), joint.parts, moves=True))
            for joint in joints
        )
        body = WorldBody(
            name, shapes, kind, position, quaternion, anchored, marker, scale, size, joints
        )
        self.bodies[name] = body
        for joint in joints:
            part = WorldBody(part_name(name, joint.name), joint.parts, marker=marker, part_of=name)
            self.bodies[part.name] = part
        return body

    def body(self, name: str) -> WorldBody:
        """Return a body by name.

        Raises:
            UnknownNameError: If the world has no such body.
        """
        if name not in self.bodies:
            raise UnknownNameError("body of this world", name, self.bodies)
        return self.bodies[name]

    def set_pose(self, name: str, position: Any, quaternion: Any = IDENTITY) -> None:
        """Move a body.

        Args:
            name: Body name.
            position: Three numbers (m, world).
            quaternion: Four numbers, wxyz.

        Raises:
            UnknownNameError: If the world has no such body.
            SimulationError: If there are more numbers than that, or fewer, or they are not finite,
                or the quaternion is no rotation.
        """
        self.set_poses((name,), position, quaternion)

    def set_poses(self, names: Iterable[str], position: Any, quaternion: Any = IDENTITY) -> None:
        """Move several bodies to the same pose; see `set_pose`."""
        if isinstance(names, str):
            raise SimulationError(f"set_poses takes several names; set_pose takes one, {names!r}")
        names = list(names)
        pose = self._in_world(self._pose(", ".join(map(str, names)), position, quaternion))
        rows = self._placements.bodies
        for name in names:
            if (owner := self.body(name).part_of) is not None:
                raise SimulationError(
                    f"{name!r} is a part of {owner!r}, which a joint moves; place {owner!r}, or its"
                    " joints by set_joints"
                )
            rows.setdefault(name, {})[self._number] = pose

    def set_joints(self, name: str, **positions: float) -> None:
        """Move joints of a body; those that are left out stay where they are.

        Args:
            name: The body.
            **positions: By the joint's name (m, rad).

        Raises:
            UnknownNameError: If the world has no such body, or that no such joint.
            DescriptorError: If a joint cannot be there.
        """
        joints = {joint.name: joint for joint in self.body(name).joints}
        for joint, position in positions.items():
            if joint not in joints:
                raise UnknownNameError(f"joint of {name}", joint, joints)
            joints[joint].check(position)
        rows = self._placements.joints.setdefault(name, {})
        rows.setdefault(self._number, {}).update(positions)

    def stand(self, robot: str, qpos: Any) -> None:
        """Stand a robot at its base pose, at rest.

        Args:
            robot: Its name in the layout.
            qpos: Joint positions in the order of the descriptor's joints, (dof,) (rad, m).

        Raises:
            UnknownNameError: If the layout has no such robot.
            SimulationError: If there are more numbers than joints, or fewer, or they are not
                finite.
        """
        joints = self.layout[robot].robot.joints
        numbers = self._floats(qpos, len(joints), f"qpos of robot {robot!r}", "rad, m")
        self._placements.robots.setdefault(robot, {})[self._number] = np.array(numbers, float)

    def _check_body(self, name: object, shapes: tuple[object, ...], kind: object) -> None:
        if not isinstance(name, str) or not name:
            raise SimulationError(f"a body's name is {shown(name)}; it must be a text")
        for shape in shapes:
            if not isinstance(shape, Shape):
                raise SimulationError(
                    f"body {name!r}: {shown(shape)} is no shape; shapes are Box, Sphere, Cylinder,"
                    " Capsule, ConvexHull, Mesh and Plane"
                )
        checked_choice(f"body {name!r}: kind", kind, _KINDS, SimulationError)

    def _built(self, name: str, shapes: tuple[Shape, ...], *, moves: bool) -> tuple[Shape, ...]:
        """Return what is built of a body's shapes; ``moves`` tells whether physics moves it."""
        for shape in shapes if moves else ():
            if isinstance(shape, Mesh) and shape.collides and shape.collision == "surface":
                raise SimulationError(
                    f"body {name!r}: the mesh {shape.file} collides by its surface, which physics"
                    " cannot move; take collision='hull' or 'parts', or another kind of body"
                )
        return tuple(part for shape in shapes for part in built_of(shape, f"body {name!r}"))

    def _pose(self, body: str, position: Any, quaternion: Any) -> list[float]:
        place = self._floats(position, 3, f"position of body {body!r}", "m")
        if quaternion is IDENTITY:
            return [*place, *IDENTITY]
        turn = self._floats(quaternion, 4, f"quaternion of body {body!r}", "w, x, y, z")
        what = f"quaternion of body {body!r} in environment {self._number}"
        expect_unit(what, turn, SimulationError)
        return [*place, *turn]

    def _in_world(self, pose: list[float]) -> list[float]:
        """Return a pose that was given, position (m) and quaternion (wxyz), in the world."""
        return pose

    def _floats(self, values: Any, count: int, what: str, unit: str) -> list[float]:
        try:
            floats = values.tolist() if hasattr(values, "tolist") else [float(x) for x in values]
            if isfinite(sum(floats)) and len(floats) == count:
                return floats
        except (TypeError, ValueError):  # no numbers, or several rows of them
            pass
        raise SimulationError(
            f"{what} in environment {self._number} is {shown(values)}; it must be {count} finite"
            f" numbers ({unit})"
        )


def add_table(world: World, *, textured: bool = True) -> None:
    """Add the table (a kinematic body called ``table-workspace``) and the ground.

    The table is kinematic, not static: contacts against a static one are solved differently.

    Args:
        world: The world.
        textured: Whether pictures show wood; else the table is white.

    Raises:
        AssetError: If the world has visuals and their files cannot be found.
    """
    drawn = world.visuals  # a box and a plane stand for mesh and texture where nothing is drawn
    box = Box(
        half_size=TABLE_HALF_SIZE,
        position=(0.0, 0.0, TABLE_HEIGHT / 2),
        color=(0.55, 0.42, 0.32, 1.0),
        visible=not drawn,
    )
    world.add(
        "table-workspace",
        box,
        *(_table_mesh(textured=textured) if drawn else ()),
        kind="kinematic",
        position=TABLE_POSITION,
        quaternion=TABLE_QUATERNION,
        anchored=True,
    )
    plane = Plane(
        position=(0.0, 0.0, GROUND_HEIGHT),
        quaternion=(0.7071068, 0.0, -0.7071068, 0.0),  # plane normal +x turned to +z
        color=(0.35, 0.37, 0.4, 1.0),
        visible=not drawn,
    )
    world.add("ground", plane, *(_floor() if drawn else ()), kind="static")


def _table_mesh(*, textured: bool) -> tuple[Shape]:
    mesh = Mesh(
        file=TABLE.locate(),
        scale=(TABLE_MESH_SCALE, TABLE_MESH_SCALE, TABLE_MESH_SCALE),
        quaternion=TABLE_QUATERNION,
        textured=textured,
        color=WHITE,
        collides=False,
    )
    return (mesh,)


def _floor() -> tuple[Shape]:
    # mani_skill 3.0.1, utils/building/ground.py
    texture = GROUND_TEXTURE.locate()
    return (Floor(texture=texture, position=(0.0, 0.0, GROUND_HEIGHT)),)
