"""A task as a page in the browser: its robots where they start, and its bodies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from layouts.viewer import ShownCell, ShownMotion, Thing
from layouts.visuals import Visual, coloured, load_meshes
from objects.shapes import Mesh, Plane, Shape
from objects.solids import surface
from robot_layouts.kinematics.rotations import Floats, pose_matrix
from robots import TaskError
from tasks.engine.env import TaskEnv
from tasks.native.format import articulation_keys, body_poses, declared_joints

PLANE_SIZE = 6.0  # m, of what is drawn of an infinite plane
ROOT = 13  # numbers of a row before the joints: the root's pose and velocities


def task_cell(task: TaskEnv, title: str, motion: ShownMotion | None = None) -> ShownCell:
    """Return what a page shows of a task as it stands now, in its first environment.

    Args:
        task: A task that has been reset.
        title: What the page calls it.
        motion: What its robots and bodies do.

    Raises:
        AssetError: If a robot's files cannot be found.
        MissingPackageError: If trimesh or python-fcl is not installed.
    """
    world, state = task.simulation.worlds[0], task.simulation.read()
    drawn = {name: live_thing(task, name) for name in world.bodies}
    things = {name: thing for name, thing in drawn.items() if thing is not None}
    start = {name: state.qpos(name)[0].astype(float) for name in task.layout}
    return ShownCell(title, task.standing(), things, motion, start)


def live_thing(task: TaskEnv, name: str) -> Thing | None:
    """Return what a page shows of a body as it is now, or None if that is not drawn.

    Args:
        task: A task that has been reset.
        name: The body.
    """
    parts = body_parts(task.simulation.worlds[0].bodies[name].shapes)
    pose = task.simulation.read().pose(name)[0].astype(float)
    return Thing(parts, pose) if parts else None


def recorded_motion(task: TaskEnv, states: Mapping[str, Mapping[str, NDArray[Any]]]) -> ShownMotion:
    """Return the motion that recorded states describe.

    Args:
        task: The task they are of, with one environment.
        states: State dict of `TaskEnv.get_state_dict`, each entry (T + 1, k).

    Raises:
        TaskError: If a robot is not in them, or an entry is of something else.
    """
    world = task.simulation.worlds[0]
    qpos: dict[str, Floats] = {}
    for name, key in articulation_keys(task.layout).items():
        rows, joints = states.get("articulations", {}).get(key), task.layout[name].robot.dof
        if rows is None or rows.shape[1] != ROOT + 2 * joints:
            raise TaskError(f"the states have no row of {ROOT + 2 * joints} numbers for {key!r}")
        own = declared_joints(task.simulation.index, name, rows[:, ROOT : ROOT + joints])
        qpos[name] = own.astype(float)
    poses = {
        name: rows.astype(float)
        for name, rows in body_poses(world, states).items()
        if body_parts(world.bodies[name].shapes)
    }
    return ShownMotion(1 / task.scenario.control_frequency, qpos, poses)


def body_parts(shapes: tuple[Shape, ...]) -> tuple[Visual, ...]:
    """Return what a body looks like, in its own frame; shapes that are not drawn are left out."""
    return tuple(part for shape in shapes if shape.visible for part in _parts(shape))


def _parts(shape: Shape) -> list[Visual]:
    import trimesh

    pose = pose_matrix(shape.position, shape.quaternion)
    match shape:
        case Plane():
            half = PLANE_SIZE / 2
            corners = [(0.0, y, z) for y, z in ((-half, -half), (half, -half), (half, half))]
            corners.append((0.0, -half, half))
            plane = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]])
            meshes = [plane.apply_transform(pose)]
        case Mesh():
            meshes = load_meshes(str(shape.path), "a body of the task")
            meshes = [mesh.apply_scale(shape.scale).apply_transform(pose) for mesh in meshes]
        case _:
            meshes = [trimesh.Trimesh(*surface(shape), process=False)]
    return [coloured(mesh, shape.color) for mesh in meshes]
