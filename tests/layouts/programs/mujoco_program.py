"""MuJoCo reads exported cells: links, pairs, TCPs; steps them, and they hold their keyframe."""

import sys
import time
from itertools import combinations
from pathlib import Path

import mujoco
import numpy as np

from layouts.export.cell import ExportedCell
from robots.bodies.hulls import load_model
from tests.layouts.travelling import EXACT, cells, draws, link_poses

STEPS = 1000
DRIFT = 1e-6  # rad, m


def check(name, layout, folder):
    start = time.process_time()
    path = layout.to_mjcf(folder / f"{name}.xml")
    written = time.process_time() - start
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    cell = ExportedCell.read(layout, visuals=False)
    worst = max(compare(model, data, *draw) for draw in draws(cell))
    assert worst < EXACT, (name, worst)
    compare_pairs(model, cell)
    drift = hold(model, data, cell)
    print(f"{name}: written in {written:.1f} s, {worst:.1e} m, drift {drift:.1e}", flush=True)


def compare(model, data, positions, poses):
    for (place, joint), value in positions.items():
        data.joint(f"{place}/{joint}").qpos[0] = value
    mujoco.mj_kinematics(model, data)
    error = 0.0
    for (place, link), pose in poses.items():
        body = data.body(f"{place}/{link}")
        error = max(
            error,
            np.abs(body.xpos - pose[:3, 3]).max(),
            np.abs(body.xmat.reshape(3, 3) - pose[:3, :3]).max(),
        )
    return error


def compare_pairs(model, cell):
    """Of two links of a robot, MuJoCo looks at those that `Layout.validate` counts.

    It leaves out those that are excluded and, by itself, those that are rigid with each other.
    """
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT
    excluded = {
        frozenset((signature >> 16, signature & 0xFFFF))
        for signature in model.exclude_signature.tolist()
    }
    for place, standing in cell.robots.items():
        own = load_model(standing.placement.robot)
        counted = {
            frozenset(f"{place}/{own.link_name(hull)}" for hull in pair) for pair in own.self_pairs
        }
        bodies = [model.body(f"{place}/{link}").id for link in standing.source.model.collisions]
        left = {
            frozenset(model.body(body).name for body in pair)
            for pair in combinations(bodies, 2)
            if frozenset(pair) not in excluded
            and model.body_weldid[pair[0]] != model.body_weldid[pair[1]]
        }
        assert left == counted


def hold(model, data, cell):
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    home = data.qpos.copy()
    mujoco.mj_forward(model, data)
    for place, standing in cell.robots.items():
        for link, pose in link_poses(standing, standing.home).items():
            assert np.abs(data.body(f"{place}/{link}").xpos - pose[:3, 3]).max() < EXACT
    for tool in cell.tools:
        expected = cell.robots[tool.place].poses[tool.link] @ [*tool.position, 1.0]
        found = data.site(f"{tool.arm.replace('.', '/')}/tcp").xpos
        assert np.abs(found - expected[:3]).max() < EXACT
    for _ in range(STEPS):
        mujoco.mj_step(model, data)
    assert not any(warning.number for warning in data.warning), [*data.warning]
    drift = np.abs(data.qpos - home).max()
    assert drift < DRIFT, drift
    return drift


if __name__ == "__main__":
    for cell_name, cell_layout in cells(sys.argv[2:]).items():
        check(cell_name, cell_layout, Path(sys.argv[1]))
