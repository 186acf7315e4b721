"""A world as a model for MuJoCo's own programs: robots, bodies, and where they are."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from layouts.export.files import LICENCES, expect_ending, licence_note, replaced_folder
from objects import ObjectDescriptor
from robot_layouts.core.writing import write_whole
from robot_layouts.simulation.mujoco import mujoco
from robot_layouts.simulation.mujoco.bodies import PREFIX
from robot_layouts.simulation.mujoco.model import Inventory, RobotModels, rub_joints
from robot_layouts.simulation.state import State
from robot_layouts.simulation.world import World

NOW = "now"  # the keyframe


def write_mjcf_world(
    world: World,
    state: State,
    path: str | os.PathLike[str],
    things: Iterable[ObjectDescriptor] = (),
) -> Path:
    """Write a simulation's first world as one MJCF; see `tasks.TaskEnv.to_mjcf`."""
    target = expect_ending(path, "MJCF", ".xml")
    models = RobotModels(world.layout, visuals=True)
    spec = models.describe(world, drawn=True)
    spec.modelname = target.stem
    model = spec.compile()
    rub_joints(model, world)
    for number in range(model.njnt):
        spec.joint(model.joint(number).name).frictionloss = _friction(model, number)
    _add_key(spec, model, Inventory(model, world, models.cell), state)
    _name_plainly(spec)
    folder = target.absolute().with_name(f"{target.stem}_assets")
    spec.meshdir = folder.name
    with replaced_folder(folder, _is_own, "save the model under another name") as made:
        note = licence_note((source.robot for source in models.cell.sources), things)
        for name, content in {LICENCES: note, **models.meshes}.items():
            write_whole(made / name, content)
        write_whole(target, spec.to_xml())
    return target


def _is_own(found: Path) -> bool:
    return found.name == LICENCES or (
        found.is_dir() and all(file.suffix == ".stl" for file in found.iterdir())
    )


def _friction(model: Any, joint: int) -> float:
    return float(model.dof_frictionloss[model.jnt_dofadr[joint]])


def _add_key(spec: Any, model: Any, index: Inventory, state: State) -> None:
    """Add a keyframe with a state: where all stands, and drives that hold the robots there."""
    qpos, data = model.qpos0.copy(), mujoco.MjData(model)
    for robot, joints in index.robots.items():
        qpos[joints.qpos] = state.qpos(robot)[0]
    for body, joints in index.jointed.items():
        rows = state.body_joints(body)[0]
        qpos[joints.qpos] = rows[: len(joints.qpos)]
    for name, number in index.built.bodies.items():
        body, pose = model.body(number + 1), state.pose(name)[0]
        if model.body_mocapid[body.id] >= 0:
            moved = model.body_mocapid[body.id]
            data.mocap_pos[moved], data.mocap_quat[moved] = pose[:3], pose[3:]
        elif body.jntnum[0] and model.jnt_type[body.jntadr[0]] == mujoco.mjtJoint.mjJNT_FREE:
            start = model.jnt_qposadr[body.jntadr[0]]
            qpos[start : start + 7] = pose
    ctrl = qpos[model.jnt_qposadr[model.actuator_trnid[:, 0]]]
    mocap = {"mpos": data.mocap_pos.ravel(), "mquat": data.mocap_quat.ravel()}
    spec.add_key(name=NOW, qpos=qpos, ctrl=ctrl, **mocap)


def _name_plainly(spec: Any) -> None:
    """Call bodies and their joints as the task does, and what tells apart those that touch so."""
    for exclude in spec.excludes:
        exclude.bodyname1 = exclude.bodyname1.removeprefix(PREFIX)
        exclude.bodyname2 = exclude.bodyname2.removeprefix(PREFIX)
    for named in (*spec.bodies, *spec.joints):
        named.name = named.name.removeprefix(PREFIX)
