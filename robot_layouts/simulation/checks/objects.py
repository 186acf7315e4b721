"""Tries things: whether they stand still on a table, and whether grasps of them hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from string import Template
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from layouts import Layout, single
from objects import Grasp, ObjectDescriptor
from objects.shapes import Shape
from objects.solids import mass_of
from robot_layouts.core.writing import write_whole
from robot_layouts.kinematics.rotations import (
    Floats,
    inverse,
    inverse_pose,
    multiply,
    pose_matrix,
    quaternion_of,
    rotate,
    rotation_of,
    rpy_pose,
)
from robot_layouts.simulation.checks.overlaps import stand
from robot_layouts.simulation.physics import SAPIEN_DEFAULTS
from robot_layouts.simulation.simulation import Simulation
from robot_layouts.simulation.world import World, add_table
from robots import (
    ActionSplit,
    Fingers,
    GripperMaterial,
    Home,
    JointGroup,
    LocalUrdf,
    RobotDescriptor,
)

THING, HAND = "thing", "hand"  # their names in a world
DRIFT, TURN = 1e-3, 0.02  # m and rad; a thing that moves farther does not stand still
STANDS = 10.0  # s
OPENINGS = (0.04, 0.07, 0.1)  # m; of the hands that grasps are tried with
SLIPS, TURNS = 0.02, 0.75  # m, how wide the pads are, and rad; what moves farther is not held

_FREQUENCY = 100.0  # Hz
_AJAR = 4e-3  # m; between each finger and what it is to hold, before it closes
_CLOSING, _HOLDING, _SHAKING = 80, 20, 60  # steps; the last along each axis
_SWAY, _PERIOD = 0.0125, 20  # m to both sides, and steps: 12 m/s²
_MISSES, _LEANS = 2e-3, 0.05  # m and rad; by how much a hand may miss a grasp that is tried again
_WEIGHTLESS = replace(SAPIEN_DEFAULTS, gravity=(0.0, 0.0, 0.0))
_SQUEEZE = 0.05  # m by which fingers are driven beyond each other
_NEXT_TO_NOTHING = 0.1  # kg/m³
_LEAST, _PER_MASS = 8.0, 70.0  # N and N/kg: how hard jaws press


class RestTrial(NamedTuple):
    """What was seen of a thing that was put on a table.

    Attributes:
        name: The thing.
        rest: How it was put there.
        drift: How far it moved (m).
        sank: How much of that was down (m).
        turned: By how much it turned (rad).
    """

    name: str
    rest: str
    drift: float
    sank: float
    turned: float

    @property
    def problem(self) -> str | None:
        """What is wrong, or None."""
        if self.drift < DRIFT and self.turned < TURN:
            return None
        return (
            f"{self.name}, put down {self.rest}, moves by {self.drift * 1e3:.2g} mm (down by"
            f" {self.sank * 1e3:.2g} mm) and turns by {self.turned:.2g} rad in {STANDS:g} s"
        )


class TriedGrasp(NamedTuple):
    """What was seen of a grasp.

    Attributes:
        grasp: The grasp.
        grasped: Whether both fingers still pressed on the thing after the shake.
        slipped: How far what is held moved in the hand meanwhile (m).
        turned: By how much the thing turned in the hand (rad).
    """

    grasp: Grasp
    grasped: bool
    slipped: float
    turned: float

    @property
    def holds(self) -> bool:
        """Whether the thing stayed in the hand."""
        return self.grasped and self.slipped < SLIPS and self.turned < TURNS


def try_rests(things: Iterable[ObjectDescriptor], time: float = STANDS) -> list[RestTrial]:
    """Put things on a table in all the ways in which they rest, and watch them.

    Args:
        things: The things.
        time: For how long (s).

    Raises:
        RobotLayoutsError: If one cannot be built.
    """
    alike: dict[tuple[str, ...], list[ObjectDescriptor]] = {}
    for thing in things:
        alike.setdefault(tuple(joint.name for joint in thing.joints), []).append(thing)
    return [trial for group in alike.values() for trial in _rested(group, time)]


def _rested(things: Sequence[ObjectDescriptor], time: float) -> list[RestTrial]:
    """Try the rests of things whose joints have the same names."""
    cases = [(thing, rest) for thing in things for rest in thing.rests]

    def build(world: World, number: int) -> None:
        add_table(world, textured=False)
        thing, rest = cases[number]
        place = (0.0, 0.0, thing.height(rest))
        turn, joints = thing.rest(rest), thing.joints
        world.add(THING, *thing.parts, position=place, quaternion=turn, joints=joints)

    with TemporaryDirectory() as folder:
        away = Home(position=(0.0, 0.0, 3.0))
        hand = replace(two_jaw_hand(max(OPENINGS), Path(folder)), home=away)
        simulation = _stood(single({HAND: hand}), build, len(cases))
        before = simulation.read().pose(THING).astype(float)
        for _ in range(round(time * 20)):
            simulation.coast(range(len(cases)))
        after = simulation.read().pose(THING).astype(float)
    moved = after[:, :3] - before[:, :3]
    return [
        RestTrial(
            thing.name,
            rest,
            float(np.linalg.norm(way)),
            float(-way[2]),
            _angle(one[3:], other[3:]),
        )
        for (thing, rest), way, one, other in zip(cases, moved, before, after, strict=True)
    ]


def try_thing_grasps(
    thing: ObjectDescriptor,
    opening: float,
    grasps: Sequence[Grasp] | None = None,
    *,
    seed: int | None = None,
) -> list[TriedGrasp]:
    """Grasp a thing with a flying hand of two jaws, and shake it along every axis.

    Nothing has weight; the shake is stronger than that. Joints are stiff at zero, and what is held
    by a part that a joint moves is as light as that part: the rest of it stands somewhere.

    Args:
        thing: The thing.
        opening: How far the hand opens (m).
        grasps: Which grasps; None takes all that the hand opens wide enough for.
        seed: Draws, for each grasp, by how much the hand misses it, up to 2 mm along and 0.05 rad
            about each axis, and three other axes to shake along; None: it misses none.

    Raises:
        RobotLayoutsError: If it cannot be built.
    """
    tried = thing.grasps_for(opening) if grasps is None else tuple(grasps)
    if not tried:
        return []
    heaviest = max(mass_of(_carried(thing, grasp)).mass for grasp in tried)
    with TemporaryDirectory() as folder:
        hand = two_jaw_hand(opening, Path(folder), _LEAST + _PER_MASS * heaviest)
        return _shaken(thing, hand, tried, seed)


def holding(
    thing: ObjectDescriptor,
    openings: Sequence[float] = OPENINGS,
    seeds: Sequence[int | None] = (None,),
) -> ObjectDescriptor:
    """Return a thing with those of its grasps alone that hold it when they are tried.

    Each is tried with all hands that open wide enough; see `try_thing_grasps`.

    Args:
        thing: The thing.
        openings: How far the hands open (m).
        seeds: How each grasp is missed, and the hand shaken, each time that it is tried.

    Raises:
        RobotLayoutsError: If it cannot be built.
    """
    tried = [
        one
        for opening in openings
        for seed in seeds
        for one in try_thing_grasps(thing, opening, seed=seed)
    ]
    failed = {one.grasp for one in tried if not one.holds}
    held = {one.grasp for one in tried} - failed
    return replace(thing, grasps=tuple(grasp for grasp in thing.grasps if grasp in held))


def _shaken(
    thing: ObjectDescriptor, hand: RobotDescriptor, grasps: Sequence[Grasp], seed: int | None
) -> list[TriedGrasp]:
    poses = [inverse_pose(pose_matrix(grasp.position, grasp.quaternion)) for grasp in grasps]
    axes = np.tile(np.eye(3), (len(grasps), 1, 1))
    if seed is not None:
        rng = np.random.default_rng(seed)
        poses = [_miss(rng) @ pose for pose in poses]
        turns = rng.normal(size=(len(grasps), 4))
        axes = rotation_of(turns / np.linalg.norm(turns, axis=1, keepdims=True))

    def build(world: World, number: int) -> None:
        place, turned = poses[number][:3, 3].tolist(), quaternion_of(poses[number][:3, :3])
        shapes, turn = _held(thing, grasps[number]), tuple(turned.tolist())
        world.add(THING, *shapes, position=place, quaternion=turn)

    layout, count = single({HAND: hand}), len(grasps)
    simulation = _stood(layout, build, count, weightless=True)
    for world, grasp in zip(simulation.worlds, grasps, strict=True):
        ajar = grasp.opening / 2 + _AJAR
        world.stand(HAND, [0.0, 0.0, 0.0, ajar, ajar])
    places = np.array([grasp.position for grasp in grasps])
    action = np.zeros((count, layout.action_dim), np.float32)
    wide = np.array([2 * (grasp.opening / 2 + _AJAR + _SQUEEZE) for grasp in grasps])
    ajar = wide / (layout[HAND].robot.keyframes["rest"][-1] + _SQUEEZE) - 1
    held = None
    for step in range(_CLOSING + _HOLDING + 3 * _SHAKING):
        axis, at = divmod(step - _CLOSING - _HOLDING, _SHAKING)
        action[:, :3], closed = 0.0, min(step / _CLOSING, 1.0)
        action[:, -1] = ajar + closed * (-1.0 - ajar)
        if axis >= 0:
            action[:, :3] = axes[:, axis] * np.sin(2 * np.pi * at / _PERIOD)
        simulation.step(action, simulation.read().joint_positions)
        if step == _CLOSING + _HOLDING - 1:
            held = _in_hand(simulation, places)
    assert held is not None
    end = _in_hand(simulation, places)
    grasped = simulation.read().is_grasping(HAND, THING)
    return [
        TriedGrasp(
            grasp,
            bool(grasped[i]),
            float(np.linalg.norm(end[0][i] - held[0][i])),
            _angle(held[1][i], end[1][i]),
        )
        for i, grasp in enumerate(grasps)
    ]


def _miss(rng: np.random.Generator) -> Floats:
    """Return by how much a hand misses a thing, (4, 4)."""
    return rpy_pose(rng.uniform(-_MISSES, _MISSES, 3), rng.uniform(-_LEANS, _LEANS, 3).tolist())


def _held(thing: ObjectDescriptor, grasp: Grasp) -> list[Shape]:
    """Return the shapes of a thing; those weigh next to nothing that the hand does not carry."""
    carried = _carried(thing, grasp)
    return [
        part if part in carried else replace(part, density=_NEXT_TO_NOTHING)
        for part in thing.all_parts
    ]


def _carried(thing: ObjectDescriptor, grasp: Grasp) -> tuple[Shape, ...]:
    return next((j.parts for j in thing.joints if j.name == grasp.part), thing.all_parts)


def _stood(
    layout: Layout,
    build: Callable[[World, int], None],
    count: int,
    *,
    weightless: bool = False,
) -> Simulation:
    """Return worlds with a hand that stands at its start."""
    physics = _WEIGHTLESS if weightless else SAPIEN_DEFAULTS
    frequency = _FREQUENCY if weightless else 20.0
    simulation = Simulation(layout, build, count, physics, control_frequency=frequency)
    stand(simulation)
    simulation.rest(simulation.read(), range(count))
    return simulation


def _in_hand(simulation: Simulation, places: Floats) -> tuple[Floats, Floats]:
    """Return where points of the things are in the hand, (N, 3) (m), and how they are turned."""
    state = simulation.read()
    hand, thing = state.link_pose(HAND, "palm").astype(float), state.pose(THING).astype(float)
    points = np.array(
        [
            rotate(inverse(h[3:]), t[:3] + rotate(t[3:], place) - h[:3])
            for h, t, place in zip(hand, thing, places, strict=True)
        ]
    )
    turned = [multiply(inverse(h[3:]), t[3:]) for h, t in zip(hand, thing, strict=True)]
    return points, np.array(turned)


def _angle(one: Floats, other: Floats) -> float:
    """Return the angle between two orientations, wxyz (rad)."""
    turn = multiply(inverse(one), other)
    return float(2 * np.arctan2(np.linalg.norm(turn[1:]), abs(turn[0])))


def two_jaw_hand(opening: float, folder: Path, force: float = _LEAST) -> RobotDescriptor:
    """Return a hand with two jaws that flies along three axes; its URDF is written.

    Its frame is that of `robots.gripper_motion`, with the origin between its pads.

    Args:
        opening: How far the jaws part (m).
        folder: Where to write the URDF.
        force: With which each jaw presses (N).

    Raises:
        UnwritableFileError: If it cannot be written.
    """
    path = folder / f"hand_{opening * 1e3:.0f}.urdf"
    model = files("robot_layouts.simulation.checks") / "two_jaw_hand.urdf.txt"
    text = Template(model.read_text(encoding="utf-8"))
    write_whole(path, text.substitute(half=opening / 2, squeeze=_SQUEEZE, wide=opening + 0.06))
    slides, jaws = ("slide_x", "slide_y", "slide_z"), ("left", "right")
    return RobotDescriptor(
        name="two_jaw_hand",
        urdf=LocalUrdf(path),
        action_split=ActionSplit(
            arm=JointGroup(
                slides,
                lower=-_SWAY,
                upper=_SWAY,
                stiffness=1e5,
                damping=2e2,
                force_limit=1e4,
                unit="m",
                reset_noise=False,
                limits=((-1.0, 1.0),) * 3,
            ),
            gripper=JointGroup(
                jaws,
                mimic=True,
                lower=-_SQUEEZE,
                upper=opening / 2,
                stiffness=4e3,
                damping=1e2,
                force_limit=force,
                unit="m",
                reset_noise=False,
                limits=((-_SQUEEZE, opening / 2),) * 2,
            ),
        ),
        tcp_link="palm",
        keyframes={"rest": (0.0, 0.0, 0.0, opening / 2, opening / 2)},
        fingers=Fingers(("left_jaw", "right_jaw")),
        gripper_material=GripperMaterial(("left_jaw", "right_jaw"), 1.0, 1.0),
        reach=1.0,
        source="robot_layouts.simulation.checks.objects",
    )
