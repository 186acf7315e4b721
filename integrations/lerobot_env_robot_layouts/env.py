"""A repository of LeRobot's hub: ``make_env("USER/REPOSITORY", trust_remote_code=True)``.

Put a copy of this file into a repository of yours on the hub, and say in it what others shall get.
They need ``pip install robot-layouts lerobot_env_robot_layouts``. LeRobot passes ``cfg`` where
somebody has options of their own: ``lerobot-eval --env.type=robot_layouts
--env.hub_path=USER/REPOSITORY --trust_remote_code=true --env.task=…``.
"""

from gymnasium.vector import VectorEnv
from lerobot_env_robot_layouts import RobotLayoutsEnv


def make_env(
    n_envs: int = 1, use_async_envs: bool = False, cfg: RobotLayoutsEnv | None = None
) -> dict[str, dict[int, VectorEnv]]:
    """Return the vectors by task; each observes pixels and states, and has an instruction."""
    wanted = cfg or RobotLayoutsEnv(task="TwoRobotPickCube-v1", cameras=True)
    return wanted.create_envs(n_envs, use_async_envs)
