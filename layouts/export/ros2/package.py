"""What makes a folder a ROS 2 package: manifest, build file, launch file."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

from layouts.export.folders import LICENCES
from layouts.export.ros2.control import BROADCASTER

NEEDED = (
    "controller_manager",
    "hardware_interface",
    "joint_state_broadcaster",
    "joint_trajectory_controller",
    "moveit_configs_utils",
    "moveit_kinematics",
    "moveit_planners_ompl",
    "moveit_ros_move_group",
    "moveit_simple_controller_manager",
    "robot_state_publisher",
    "xacro",
)

CMAKE = """\
cmake_minimum_required(VERSION 3.8)
project({package})

find_package(ament_cmake REQUIRED)

install(
  DIRECTORY config launch meshes urdf
  DESTINATION share/${{PROJECT_NAME}}
)
install(FILES {licences} DESTINATION share/${{PROJECT_NAME}})

ament_package()
"""

LAUNCH = '''\
"""Starts the cell with hardware that only pretends, its controllers, and MoveIt."""

from ament_index_python.packages import get_package_share_path
from launch import LaunchDescription
from launch_ros.actions import Node
from moveit_configs_utils import MoveItConfigsBuilder

PACKAGE = {package!r}
CONTROLLERS = {controllers}


def generate_launch_description():
    share = get_package_share_path(PACKAGE)
    moveit = (
        MoveItConfigsBuilder(PACKAGE, package_name=PACKAGE)
        .robot_description(file_path=f"urdf/{{PACKAGE}}.urdf.xacro")
        .robot_description_semantic(file_path=f"config/{{PACKAGE}}.srdf")
        .robot_description_kinematics(file_path="config/kinematics.yaml")
        .joint_limits(file_path="config/joint_limits.yaml")
        .trajectory_execution(file_path="config/moveit_controllers.yaml")
        .planning_pipelines(pipelines=["ompl"])
        .to_moveit_configs()
    )
    publisher = Node(
        package="robot_state_publisher",
        executable="robot_state_publisher",
        parameters=[moveit.robot_description],
    )
    manager = Node(
        package="controller_manager",
        executable="ros2_control_node",
        parameters=[str(share / "config" / "ros2_controllers.yaml")],
        remappings=[("~/robot_description", "/robot_description")],
    )
    spawner = Node(package="controller_manager", executable="spawner", arguments=CONTROLLERS)
    move_group = Node(
        package="moveit_ros_move_group",
        executable="move_group",
        parameters=[moveit.to_dict()],
    )
    return LaunchDescription([publisher, manager, spawner, move_group])
'''


def manifest(package: str, licences: Sequence[str]) -> Element:
    """Return the package's ``package.xml``.

    Args:
        package: Its name.
        licences: Short names of the licences of robot files.
    """
    root = Element("package", format="3")
    SubElement(root, "name").text = package
    SubElement(root, "version").text = "0.0.1"
    SubElement(root, "description").text = "A robot cell: description, controllers, MoveIt."
    SubElement(root, "maintainer", email="nobody@example.com").text = "nobody yet"
    for licence in licences:
        SubElement(root, "license", file=LICENCES).text = licence
    SubElement(root, "buildtool_depend").text = "ament_cmake"
    for needed in NEEDED:
        SubElement(root, "exec_depend").text = needed
    SubElement(SubElement(root, "export"), "build_type").text = "ament_cmake"
    return root


def cmake_lists(package: str) -> str:
    """Return the package's ``CMakeLists.txt``."""
    return CMAKE.format(package=package, licences=LICENCES)


def launch_file(package: str, controllers: Sequence[str]) -> str:
    """Return a launch file that starts the cell without hardware.

    Args:
        package: The package.
        controllers: Names of its controllers.
    """
    listed = "\n".join(f"    {name!r}," for name in (BROADCASTER, *controllers))
    return LAUNCH.format(package=package, controllers=f"[\n{listed}\n]")
