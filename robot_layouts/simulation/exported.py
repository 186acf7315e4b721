"""A world in a state, exported as layouts are: its robots where they are, and its bodies."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from layouts.export.bodies import BodyLink, ExportedBody, ExportedWorld, body_joint
from layouts.export.cell import ExportedCell
from layouts.export.files import USD_ENDINGS, expect_ending
from layouts.export.ros2 import write_ros2
from objects import ObjectDescriptor
from objects.shapes import Friction, Shape
from robot_layouts.kinematics.rotations import pose_matrix
from robot_layouts.simulation.state import State
from robot_layouts.simulation.world import World, WorldBody, part_name


def write_usd_world(
    world: World,
    state: State,
    path: str | os.PathLike[str],
    things: Iterable[ObjectDescriptor] = (),
) -> Path:
    """Write a simulation's first world as a USD stage; see `tasks.TaskEnv.to_usd`."""
    target = expect_ending(path, "a USD stage", *USD_ENDINGS)
    from layouts.export.usd import write_usd  # which needs usd-core

    return write_usd(_cell(world, state), target, _around(world, state, things))


def write_ros2_world(
    world: World,
    state: State,
    folder: str | os.PathLike[str],
    things: Iterable[ObjectDescriptor] = (),
) -> Path:
    """Write a simulation's first world as a ROS 2 package; see `tasks.TaskEnv.to_ros2`."""
    return write_ros2(_cell(world, state), folder, _around(world, state, things))


def _cell(world: World, state: State) -> ExportedCell:
    starts = {place: state.qpos(place)[0].tolist() for place in world.layout}
    return ExportedCell.read(world.layout, visuals=True, starts=starts)


def _around(world: World, state: State, things: Iterable[ObjectDescriptor]) -> ExportedWorld:
    own = (body for body in world.bodies.values() if body.part_of is None)
    bodies = (_body(body, state, world.physics.friction) for body in own)
    return ExportedWorld(tuple(bodies), tuple(things), world.physics.gravity)


def _body(body: WorldBody, state: State, friction: Friction) -> ExportedBody:
    parts = {part_name(body.name, joint.name): joint.own_parts for joint in body.joints}
    joints = {joint.name: joint for joint in body.joints}
    held = body.kind == "static" or (body.kind == "kinematic" and body.anchored)
    return ExportedBody(
        name=body.name,
        moves=body.kind == "dynamic",
        stands=held and not body.joints,
        marker=body.marker,
        links=tuple(
            _link(name, shapes, state, friction)
            for name, shapes in {body.name: body.shapes, **parts}.items()
        ),
        joints=tuple(
            body_joint(
                body.name,
                joint,
                carrier=None if joint.carrier is None else joints[joint.carrier],
                position=float(state.joint(body.name, joint.name)[0]),
            )
            for joint in body.joints
        ),
    )


def _link(name: str, shapes: tuple[Shape, ...], state: State, friction: Friction) -> BodyLink:
    pose = state.pose(name)[0]
    rough = (
        replace(shape, friction=friction) if shape.friction is None else shape for shape in shapes
    )
    return BodyLink(name, pose_matrix(pose[:3], pose[3:]), tuple(rough))
