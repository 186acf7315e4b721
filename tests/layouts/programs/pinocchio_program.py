"""Pinocchio reads exported ROS 2 packages: links, TCPs, and which pairs of bodies are left out."""

import sys
from itertools import combinations, product
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio

from layouts.export.cell import ExportedCell
from layouts.export.ros2.groups import RosNames
from robots.bodies.hulls import load_model
from tests.layouts.travelling import EXACT, cells, draws


def check(name, layout, folder):
    package = layout.to_ros2(folder / name, visuals=False)
    urdf, srdf = package / "urdf" / f"{name}.urdf", package / "config" / f"{name}.srdf"
    model = pinocchio.buildModelFromUrdf(str(urdf))
    cell = ExportedCell.read(layout, visuals=False)
    names = RosNames(cell)
    worst = max(compare(model, names, *draw) for draw in draws(cell))
    assert worst < EXACT, (name, worst)
    pairs = compare_pairs(model, names, cell, urdf, srdf, folder)
    home = check_home(model, cell, names, srdf)
    print(f"{name}: {worst:.1e} m, {pairs} pairs counted, home {home:.1e} m", flush=True)


def configuration(model, names, positions):
    q = pinocchio.neutral(model)
    for (place, joint), value in positions.items():
        own = model.joints[model.getJointId(names.joint(place, joint))]
        turns = own.nq == 2  # a joint without limits is a point on a circle
        q[own.idx_q : own.idx_q + own.nq] = [np.cos(value), np.sin(value)] if turns else [value]
    return q


def compare(model, names, positions, poses):
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, configuration(model, names, positions))
    errors = []
    for (place, link), pose in poses.items():
        frame = model.getFrameId(names.link(place, link), pinocchio.FrameType.BODY)
        errors.append(np.abs(data.oMf[frame].homogeneous - pose).max())
    return max(errors)


def compare_pairs(model, names, cell, urdf, srdf, folder):
    """Of all pairs of links that collide, those are left that `Layout.validate` counts."""
    geometry = pinocchio.buildGeomFromUrdf(
        model, str(urdf), pinocchio.GeometryType.COLLISION, package_dirs=[str(folder)]
    )
    links = [model.frames[shape.parentFrame].name for shape in geometry.geometryObjects]
    geometry.addAllCollisionPairs()
    pinocchio.removeCollisionPairs(model, geometry, str(srdf))
    # Pinocchio never looks at two shapes of one joint, such as those that stand still.
    counted = {
        frozenset((links[pair.first], links[pair.second])) for pair in geometry.collisionPairs
    }
    expected = expected_pairs(cell, names)
    joints = {link: geometry.geometryObjects[i].parentJoint for i, link in enumerate(links)}
    moving = {pair for pair in expected if len({joints[link] for link in pair}) == 2}
    assert counted == moving
    return len(counted)


def expected_pairs(cell, names):
    """Return the pairs that `Layout.validate` looks at: of two robots all, of one what it counts.

    With tables it looks at links that move; Pinocchio leaves the others out by itself.
    """
    solid = {
        place: [names.link(place, link) for link in standing.source.model.collisions]
        for place, standing in cell.robots.items()
    }
    solid.update({table: [names.frames[table]] for table in cell.tables})
    found = {
        frozenset(pair)
        for one, other in combinations(solid.values(), 2)
        for pair in product(one, other)
    }
    for place, standing in cell.robots.items():
        model = load_model(standing.placement.robot)
        for pair in model.self_pairs:
            found.add(frozenset(names.link(place, model.link_name(hull)) for hull in pair))
    return found


def check_home(model, cell, names, srdf):
    """The state ``home`` of all groups puts the TCPs where they are."""
    positions = {
        joint.get("name"): float(joint.get("value"))
        for joint in ElementTree.parse(srdf).getroot().iterfind("group_state/joint")
    }
    named = {
        (place, joint): positions.get(names.joint(place, joint), value)
        for place, standing in cell.robots.items()
        for joint, value in standing.home.items()
    }
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, configuration(model, names, named))
    errors = [0.0]
    for tool in cell.tools:
        frame = model.getFrameId(names.tool(tool), pinocchio.FrameType.BODY)
        expected = cell.robots[tool.place].poses[tool.link] @ [*tool.position, 1.0]
        errors.append(np.abs(data.oMf[frame].translation - expected[:3]).max())
    assert max(errors) < EXACT
    return max(errors)


for cell_name, cell_layout in cells(sys.argv[2:]).items():
    check(cell_name, cell_layout, Path(sys.argv[1]))
