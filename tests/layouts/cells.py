"""A cell with a robot that stands askew, one on a wall, one under a ceiling, and two of a kind."""

import io
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import yourdfpy

from layouts import Layout, Placement, ceiling, wall
from robot_layouts.kinematics.rotations import pose_matrix
from robots import RobotDescriptor


def mixed_cell() -> Layout:
    return Layout(
        {
            "left": Placement("panda_wristcam", (0.0, 0.7, 0.0), rpy=(0.1, 0.2, -1.5)),
            "hung": Placement("so100", on="wall"),
            "up": Placement("panda_stick", on="ceiling", rpy=(0.0, 0.0, 1.0)),
            "left_2": Placement("panda_wristcam", (0.5, -1.2, 0.0), keyframe="rest"),
        },
        {"wall": wall((1.3, 0.0, 0.6), yaw=0.7), "ceiling": ceiling(1.5, position=(-0.6, 0.3))},
    )


def hung(robot: str | RobotDescriptor) -> Layout:
    """One robot upside down under a ceiling, turned."""
    return Layout(
        {"arm": Placement(robot, (0.1, -0.2, 0.0), on="ceiling", rpy=(0.0, 0.0, 1.0))},
        {"ceiling": ceiling(1.5, position=(0.4, -0.3))},
    )


def skeleton(file: Path, *, mimics: bool = True) -> yourdfpy.URDF:
    """Return links and joints of a URDF, without shapes: yourdfpy knows no capsules.

    Without mimics each joint has a position of its own: yourdfpy follows no mimic of a mimic.
    """
    root = ElementTree.parse(file).getroot()
    for joint in root.findall("joint"):
        for mimic in joint.findall("mimic") if not mimics else ():
            joint.remove(mimic)
    for link in root.iterfind("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    return yourdfpy.URDF.load(io.BytesIO(ElementTree.tostring(root)))


def random_positions(placement: Placement, random: np.random.Generator) -> dict[str, float]:
    """Return positions of joints within their limits and a half-turn, mimicry respected."""
    urdf = skeleton(placement.robot.urdf.locate())
    positions = {
        joint.name: float(random.uniform(*_range(joint))) for joint in urdf.actuated_joints
    }
    for joint in urdf.robot.joints:
        if joint.mimic is not None:
            ratio = 1.0 if joint.mimic.multiplier is None else joint.mimic.multiplier
            offset = joint.mimic.offset or 0.0
            positions[joint.name] = ratio * positions[joint.mimic.joint] + offset
    return positions


def link_poses(placement: Placement, positions: dict[str, float]) -> dict[str, np.ndarray]:
    """Return the world pose of each link, by yourdfpy from the robot's own URDF."""
    urdf = skeleton(placement.robot.urdf.locate(), mimics=False)
    urdf.update_cfg({joint.name: positions[joint.name] for joint in urdf.actuated_joints})
    base = pose_matrix(placement.base_position, placement.base_quaternion)
    return {link: base @ urdf.get_transform(link) for link in urdf.link_map}


def _range(joint: yourdfpy.Joint) -> tuple[float, float]:
    """Return what a joint may be at (rad or m); single precision forbids slides of 20 m."""
    if joint.limit is None or joint.limit.lower is None:
        return -np.pi, np.pi
    return max(joint.limit.lower, -np.pi), min(joint.limit.upper, np.pi)
