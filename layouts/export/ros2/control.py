"""What drives a cell in ROS 2: ros2_control's hardware, and controllers, also as MoveIt's."""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element, SubElement

from layouts.export.cell import ExportedCell
from layouts.export.ros2.groups import Groups
from layouts.export.ros2.names import RosNames

BROADCASTER = "joint_state_broadcaster"
RATE = 100  # Hz


def hardware(cell: ExportedCell, names: RosNames) -> list[Element]:
    """Return the ``<ros2_control>`` of each robot.

    Joints that follow another one have no command; what they follow is in the URDF. The plugin is
    an argument of the xacro file, ``NAME_plugin``.
    """
    systems: list[Element] = []
    for place, standing in cell.robots.items():
        name = names.systems[place]
        system = Element("ros2_control", name=name, type="system")
        plugin = SubElement(SubElement(system, "hardware"), "plugin")
        plugin.text = f"$(arg {name}_plugin)"
        for joint in standing.source.model.moving:
            made = SubElement(system, "joint", name=names.joint(place, joint.name))
            if joint.mimics is None:
                SubElement(made, "command_interface", name="position")
            position = SubElement(made, "state_interface", name="position")
            SubElement(position, "param", name="initial_value").text = repr(
                standing.home[joint.name]
            )
            SubElement(made, "state_interface", name="velocity")
        systems.append(system)
    return systems


def controllers(groups: Groups) -> dict[str, Any]:
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


def moveit_controllers(groups: Groups) -> dict[str, Any]:
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
