"""Cells that travel to other programs, and where this library has their links."""

from __future__ import annotations

import random
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from layouts import Layout, Placement, around_table, ceiling, wall
from layouts.export.cell import ExportedCell, Standing
from robot_layouts.kinematics.rotations import pose_matrix
from robots import RobotDescriptor, RobotRegistry
from robots.registry import CATALOGUE
from robots.urdf.tree import kinematic_tree
from tests.layouts.cells import hung, mixed_cell

DRAWS = 100
EXACT = 1e-9  # m
MIXES = 12

# Joints that lean, slide, follow a follower and turn without end; a capsule; names with a slash, a
# dot and letters of case alone; a link called as the world is.
OUTSIDE = """<robot name="outside">
  <link name="world"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <link name="arm/0.5">{inertial}<collision><origin xyz="0 0 0.2" rpy="0.3 0.2 0.1"/>
    <geometry><capsule radius="0.03" length="0.2"/></geometry></collision>
    <visual><geometry><cylinder radius="0.03" length="0.2"/></geometry></visual></link>
  <link name="ARM/0.5">{inertial}</link>
  <link name="tip"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
  <link name="left">{inertial}<collision><geometry><cylinder radius="0.01" length="0.03"/>
    </geometry></collision></link>
  <link name="right">{inertial}</link>
  <joint name="lean" type="continuous"><parent link="world"/><child link="arm/0.5"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.7 -1.5707963 2.1"/><axis xyz="1 2 -2"/></joint>
  <joint name="reach" type="prismatic"><parent link="arm/0.5"/><child link="ARM/0.5"/>
    <origin xyz="0 0 0.3" rpy="1 2 3"/><axis xyz="0 0.6 0.8"/>
    <limit lower="-0.1" upper="0.2" effort="30" velocity="0.5"/></joint>
  <joint name="hold" type="fixed"><parent link="ARM/0.5"/><child link="tip"/>
    <origin rpy="0 0 0.4" xyz="0 0.1 0"/></joint>
  <joint name="close" type="revolute"><parent link="tip"/><child link="left"/>
    <origin xyz="0 0.02 0.1"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.8" effort="5" velocity="1"/>
    <dynamics damping="0.1" friction="0.2"/></joint>
  <joint name="close_2" type="revolute"><parent link="tip"/><child link="right"/>
    <origin xyz="0 -0.02 0.1"/><axis xyz="-1 0 0"/>
    <limit lower="-2" upper="2" effort="5" velocity="1"/>
    <mimic joint="close_3" multiplier="2" offset="0.1"/></joint>
  <link name="pad">{inertial}</link>
  <joint name="close_3" type="revolute"><parent link="left"/><child link="pad"/>
    <origin xyz="0 0 0.03"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="5" velocity="1"/>
    <mimic joint="close" multiplier="-0.5"/></joint>
</robot>""".format(
    inertial='<inertial><origin xyz="0 0 0.1" rpy="0.1 0.2 0.3"/><mass value="0.4"/>'
    '<inertia ixx="0.003" iyy="0.002" izz="0.004" ixy="0.0002" ixz="0" iyz="0.0001"/></inertial>'
)


def outside(folder: Path) -> RobotDescriptor:
    """Return a robot whose URDF lies in a folder of the user's."""
    path = folder / "outside.urdf"
    path.write_text(OUTSIDE)
    return RobotDescriptor.from_urdf(path, quiet=True)


def cells(only: Sequence[str] = ()) -> dict[str, Layout]:
    """Return cells by name: every robot upside down, mixes of two to four, and special ones.

    Args:
        only: Names of those that are wanted; all if there are none.
    """
    found = _cells()
    return {name: found[name] for name in only or found}


def _cells() -> dict[str, Layout]:
    robots = tuple(CATALOGUE)
    own = outside(Path(tempfile.mkdtemp()))
    grafted = RobotRegistry.load("xarm7").with_gripper("panda")
    found = {
        "mixed": mixed_cell(),
        "table": around_table({"a": "panda_wristcam", "b": "xarm7_ability", "c": "so100"}),
        "outside_2": Layout(
            {"arm": Placement(own, on="wall"), "other": Placement(own, (1.0, 0.0, 0.0))},
            {"wall": wall((1.3, 0.0, 0.6), yaw=0.7)},
        ),
        "grafted": hung(grafted),
    }
    found.update({f"hung_{name}": hung(name) for name in robots})
    draw = random.Random(0)
    for number in range(MIXES):
        chosen = draw.sample(robots, draw.randint(2, 4))
        places = {f"p{i}": Placement(name, *_stand(i, draw)) for i, name in enumerate(chosen)}
        found[f"mix_{number}"] = Layout(places, {"ceiling": ceiling(2.0)})
    return found


def _stand(number: int, draw: random.Random) -> tuple[tuple[float, ...], tuple[float, ...]]:
    turn = np.array([draw.gauss(0.0, 1.0) for _ in range(4)])
    return (3.0 * number, draw.uniform(-1, 1), 0.0), tuple((turn / np.linalg.norm(turn)).tolist())


def draws(
    cell: ExportedCell, count: int = DRAWS
) -> Iterator[tuple[dict[tuple[str, str], float], dict[tuple[str, str], np.ndarray]]]:
    """Yield joint positions, in which followers follow, and the poses of all links in the world.

    Both go by place and name; a pose is (4, 4) (m).
    """
    generator = np.random.default_rng(0)
    for _ in range(count):
        positions: dict[tuple[str, str], float] = {}
        poses: dict[tuple[str, str], np.ndarray] = {}
        for place, standing in cell.robots.items():
            own = _positions(standing, generator)
            positions.update({(place, joint): value for joint, value in own.items()})
            poses.update({(place, link): pose for link, pose in link_poses(standing, own).items()})
        yield positions, poses


def link_poses(standing: Standing, positions: dict[str, float]) -> dict[str, np.ndarray]:
    """Return the pose of each link in the world, (4, 4) (m)."""
    tree = kinematic_tree(standing.source.model)
    qpos = np.array([[positions[joint] for joint in tree.coordinates]])
    placement = standing.placement
    base = pose_matrix(placement.base_position, placement.base_quaternion)
    return dict(zip(tree.links, base @ tree.forward(qpos)[0], strict=True))


def _positions(standing: Standing, generator: np.random.Generator) -> dict[str, float]:
    joints = {joint.name: joint for joint in standing.source.model.moving}
    found: dict[str, float] = {}

    def position(name: str) -> float:
        joint = joints[name]
        if name not in found:
            low, high = np.clip(joint.span, -np.pi, np.pi)
            found[name] = (
                float(generator.uniform(low, high))
                if joint.mimics is None
                else joint.multiplier * position(joint.mimics) + joint.offset
            )
        return found[name]

    return {name: position(name) for name in joints}
