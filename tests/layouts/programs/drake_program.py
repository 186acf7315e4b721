"""Drake reads exported model directives: links, and where the robots start."""

import sys
from pathlib import Path

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import LoadModelDirectives, Parser, ProcessModelDirectives
from pydrake.multibody.plant import MultibodyPlant

from layouts.export.cell import ExportedCell
from tests.layouts.travelling import EXACT, cells, draws, link_poses


def check(name, layout, folder):
    path = layout.to_drake(folder / f"{name}.dmd.yaml", visuals=False)
    plant = MultibodyPlant(time_step=0.0)
    ProcessModelDirectives(LoadModelDirectives(str(path)), Parser(plant))
    plant.Finalize()
    cell = ExportedCell.read(layout, visuals=False)
    context = plant.CreateDefaultContext()
    start = {
        (place, link): pose
        for place, standing in cell.robots.items()
        for link, pose in link_poses(standing, standing.home).items()
    }
    home = worst_of(plant, context, start)
    worst = max(compare(plant, context, *draw) for draw in draws(cell))
    assert worst < EXACT, (name, worst)
    print(f"{name}: {worst:.1e} m, home {home:.1e} m", flush=True)


def compare(plant, context, positions, poses):
    for (place, joint), value in positions.items():
        instance = plant.GetModelInstanceByName(place)
        found = plant.GetJointByName(joint, instance)
        put = found.set_translation if found.type_name() == "prismatic" else found.set_angle
        put(context, value)
    return worst_of(plant, context, poses)


def worst_of(plant, context, poses):
    errors = []
    for (place, link), pose in poses.items():
        name = "world_link" if link == "world" else link  # that name is Drake's own
        body = plant.GetBodyByName(name, plant.GetModelInstanceByName(place))
        found: RigidTransform = plant.EvalBodyPoseInWorld(context, body)
        errors.append(np.abs(found.GetAsMatrix4() - pose).max())
    return max(errors)


for cell_name, cell_layout in cells(sys.argv[2:]).items():
    check(cell_name, cell_layout, Path(sys.argv[1]))
