"""Tasks of robot-layouts in LeRobot's evaluation, and LeRobot's policies in ours."""

from lerobot_env_robot_layouts.environments import RobotLayoutsEnv
from lerobot_env_robot_layouts.policies import LeRobotPolicy

__all__ = ["LeRobotPolicy", "RobotLayoutsEnv"]
