"""All parts of a cell at once are where each robot's own tree has them."""

import numpy as np
import pytest

from layouts import Layout, Placement
from robot_layouts.motion.collision.cell import Cell
from robot_layouts.motion.model.bodies import LinkPoses
from tests.catalogue import every_robot
from tests.motion import cells


def differences(cell: Cell, link_poses: LinkPoses, qpos: np.ndarray) -> dict[str, float]:
    places, links = link_poses.places(qpos), cell.poses(qpos)
    names = {
        row: (part.robot, cell.models[part.robot].kinematics.links[part.link])
        for i, row in link_poses.rows.items()
        if (part := cell.parts[i]).robot
    }
    return {
        "/".join(name): float(np.abs(places[row] - links[:, cell.links.index(name)]).max())
        for row, name in names.items()
    }


@pytest.mark.parametrize("robot", every_robot(quick=("fetch", "xarm7_ability")))
def test_parts_of_every_robot_are_where_its_tree_has_them(robot):
    cell = Cell(Layout({"arm": Placement(robot, (0.3, -0.2, 0.1), rpy=(0.1, 0.2, 0.3))}))
    qpos, _ = cells.states(cell, 6)
    found = differences(cell, LinkPoses(cell, range(len(cell.parts))), qpos)
    assert len(found) == len(cell.parts) - 1
    assert max(found.values(), default=0.0) < 1e-12
