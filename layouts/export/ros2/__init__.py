"""A layout as a ROS 2 package: description, MoveIt's configuration, controllers, launch file."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element, indent, tostring

import yaml

from layouts.export.cell import ExportedCell
from layouts.export.files import LICENCES, licence_note, replaced_folder, short_licences
from layouts.export.ros2.description import description, speed_of
from layouts.export.ros2.groups import PlanningGroups, RosNames
from robot_layouts.core.pages import fragment
from robots import LayoutError
from robots.bodies.allowed import joined_pairs, rigid_groups, rigid_pairs

if TYPE_CHECKING:
    from layouts.arrangement import Arrangement

BROADCASTER = "joint_state_broadcaster"
RATE = 100  # Hz
ACCELERATION = 2.0  # 1/s; times the largest speed: half a second to reach it
SCALING = 0.1  # of speeds and accelerations, unless a request asks for more
PLANNER = "RRTConnectkConfigDefault"
ENTRIES = ("CMakeLists.txt", LICENCES, "config", "launch", "meshes", "package.xml", "urdf")


def write_ros2(
    layout: Arrangement, folder: str | os.PathLike[str], *, visuals: bool = True
) -> Path:
    """Write a layout as a ROS 2 package; see `layouts.Layout.to_ros2`."""
    target = Path(folder)
    package = target.absolute().name
    if not re.fullmatch(r"[a-z](_?[a-z0-9])+", package):
        raise LayoutError(
            f"a ROS 2 package cannot be called {package!r}; its folder's name takes two or more"
            f" small letters, digits and single _, and begins with a letter: {_proper(package)!r}"
        )
    cell = ExportedCell.read(layout, visuals=visuals)
    with replaced_folder(target, _is_own, "save the package under another name") as made:
        for name in ("config", "launch", "meshes", "urdf"):
            (made / name).mkdir()
        _write(made, cell, package, visuals=visuals)
    return target


def _is_own(found: Path) -> bool:
    return found.name in ENTRIES


def _proper(package: str) -> str:
    """Return the valid package name that is closest to an invalid one."""
    plain = re.sub(r"[^a-z0-9]+", "_", package.lower()).strip("_")
    return plain if re.fullmatch(r"[a-z](_?[a-z0-9])+", plain) else f"cell_{plain}".strip("_")


def _write(folder: Path, cell: ExportedCell, package: str, *, visuals: bool) -> None:
    names = RosNames(cell)
    groups = PlanningGroups(cell, names)
    robots = [source.robot for source in cell.sources]
    meshes = folder / "meshes"
    content = {
        "package": package,
        "licences": LICENCES,
        "licence_names": short_licences(robots),
        "controllers": [BROADCASTER, *(group.controller for group in groups.own)],
        "names": names,
        "groups": groups,
        "robots": cell.robots,
        "disabled": [*_allowed_pairs(cell, names), *_pairs_on_tables(cell, names)],
    }
    texts = {
        f"urdf/{package}.urdf": _xml(description(cell, names, package, meshes, visuals=visuals)),
        f"urdf/{package}.urdf.xacro": _filled("cell.urdf.xacro", content),
        f"config/{package}.srdf": _filled("cell.srdf", content),
        "config/joint_limits.yaml": _yaml(_joint_limits(cell, names)),
        "config/kinematics.yaml": _yaml(_kinematics(groups)),
        "config/ompl_planning.yaml": _yaml(_ompl_planning(groups)),
        "config/ros2_controllers.yaml": _yaml(_controllers(groups)),
        "config/moveit_controllers.yaml": _yaml(_moveit_controllers(groups)),
        "launch/demo.launch.py": _filled("demo.launch.py", content),
        "package.xml": _filled("package.xml", content),
        "CMakeLists.txt": _filled("CMakeLists.txt", content),
        LICENCES: licence_note(robots),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


def _allowed_pairs(cell: ExportedCell, names: RosNames) -> Iterator[tuple[str, str, str]]:
    """Yield the pairs of links that `Layout.validate` lets overlap within a robot, and why.

    They are those that a joint joins (``Adjacent``), those that never move against each other
    (``Never``), and the rest of the robot's ``allowed_collisions`` (``Default``).
    """
    for place, standing in cell.robots.items():
        model = standing.source.model
        joined, rigid = joined_pairs(model), rigid_pairs(model)
        for one, other in sorted(sorted(pair) for pair in standing.source.allowed):
            pair = frozenset((one, other))
            reason = "Adjacent" if pair in joined else "Never" if pair in rigid else "Default"
            yield names.link(place, one), names.link(place, other), reason


def _pairs_on_tables(cell: ExportedCell, names: RosNames) -> Iterator[tuple[str, str, str]]:
    """Yield tables and the links that stand still on them."""
    for table, (place, standing) in product(cell.tables, cell.robots.items()):
        model = standing.source.model
        for link in rigid_groups(model)[model.root]:
            if link in model.collisions:
                yield names.frames[table], names.link(place, link), "Never"


def _filled(template: str, content: Mapping[str, object]) -> str:
    return f"{fragment(f'layouts.export.ros2/{template}.jinja', **content)}\n"


def _xml(root: Element) -> str:
    indent(root)
    return f'<?xml version="1.0"?>\n{tostring(root, encoding="unicode")}\n'


def _yaml(value: dict[str, object]) -> str:
    return yaml.safe_dump(value, sort_keys=False, default_flow_style=False)


# -- controllers, and MoveIt ---------------------------------------------------------------


def _controllers(groups: PlanningGroups) -> dict[str, Any]:
    """Return the controllers, one for each group that has joints of its own."""
    kinds = {BROADCASTER: {"type": f"{BROADCASTER}/JointStateBroadcaster"}}
    own: dict[str, Any] = {}
    for group in groups.own:
        kind = "joint_trajectory_controller/JointTrajectoryController"
        kinds[group.controller] = {"type": kind}
        own[group.controller] = {
            "ros__parameters": {
                "joints": groups.joints(group),
                "command_interfaces": ["position"],
                "state_interfaces": ["position", "velocity"],
            }
        }
    manager = {"ros__parameters": {"update_rate": RATE, **kinds}}
    return {"controller_manager": manager, **own}


def _moveit_controllers(groups: PlanningGroups) -> dict[str, Any]:
    """Return which controller MoveIt sends the trajectories of which joints."""
    manager = "moveit_simple_controller_manager"
    own: dict[str, Any] = {
        group.controller: {
            "type": "FollowJointTrajectory",
            "action_ns": "follow_joint_trajectory",
            "default": True,
            "joints": groups.joints(group),
        }
        for group in groups.own
    }
    return {
        "moveit_controller_manager": f"{manager}/MoveItSimpleControllerManager",
        manager: {"controller_names": list(own), **own},
    }


def _joint_limits(cell: ExportedCell, names: RosNames) -> dict[str, Any]:
    """Return speeds and accelerations of all joints that follow none."""
    limits: dict[str, Any] = {}
    for place, standing in cell.robots.items():
        joints = {joint.name: joint for joint in standing.source.model.moving}
        for joint in standing.source.leaders:
            speed = float(speed_of(joints[joint]))
            limits[names.joint(place, joint)] = {
                "has_velocity_limits": True,
                "max_velocity": speed,
                "has_acceleration_limits": True,
                "max_acceleration": ACCELERATION * speed,
            }
    return {
        "default_velocity_scaling_factor": SCALING,
        "default_acceleration_scaling_factor": SCALING,
        "joint_limits": limits,
    }


def _kinematics(groups: PlanningGroups) -> dict[str, Any]:
    """Return the solver of each group that is a chain."""
    return {
        group.name: {
            "kinematics_solver": "kdl_kinematics_plugin/KDLKinematicsPlugin",
            "kinematics_solver_search_resolution": 0.005,
            "kinematics_solver_timeout": 0.05,
        }
        for group in groups.own
        if group.chain is not None
    }


def _ompl_planning(groups: PlanningGroups) -> dict[str, Any]:
    """Return the planning pipeline, and the planners of each group."""
    requests = ("ResolveConstraintFrames", "ValidateWorkspaceBounds", "CheckStartStateBounds",
                "CheckStartStateCollision")  # fmt: skip
    responses = ("AddTimeOptimalParameterization", "ValidateSolution", "DisplayMotionPath")
    return {
        "planning_plugins": ["ompl_interface/OMPLPlanner"],
        "request_adapters": [f"default_planning_request_adapters/{name}" for name in requests],
        "response_adapters": [f"default_planning_response_adapters/{name}" for name in responses],
        "planner_configs": {PLANNER: {"type": "geometric::RRTConnect", "range": 0.0}},
        **{
            group.name: {"default_planner_config": PLANNER, "planner_configs": [PLANNER]}
            for group in (*groups.own, *groups.made)
        },
    }
