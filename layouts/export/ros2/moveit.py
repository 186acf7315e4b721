"""MoveIt's configuration of a cell: limits, inverse kinematics and planners."""

from __future__ import annotations

from typing import Any

from layouts.export.cell import ExportedCell
from layouts.export.ros2.description import speed_of
from layouts.export.ros2.groups import Groups
from layouts.export.ros2.names import RosNames

ACCELERATION = 2.0  # 1/s; times the largest speed: half a second to reach it
SCALING = 0.1  # of speeds and accelerations, unless a request asks for more
PLANNER = "RRTConnectkConfigDefault"


def joint_limits(cell: ExportedCell, names: RosNames) -> dict[str, Any]:
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


def kinematics(groups: Groups) -> dict[str, Any]:
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


def ompl_planning(groups: Groups) -> dict[str, Any]:
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
            group: {"default_planner_config": PLANNER, "planner_configs": [PLANNER]}
            for group in groups.names
        },
    }
