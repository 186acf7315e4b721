"""A task of robots alone, and smooth motions to carry out in it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from layouts import Layout, face_to_face
from robot_layouts.motion.motion import Motion
from tasks import MultiRobotTask


class FreeRobots(MultiRobotTask):
    """Robots that stand where their layout starts them, and nothing else."""

    layout = face_to_face({"left": "panda", "right": "xarm7"}, spacing=2.0)
    robot_counts = range(1, 9)
    max_episode_steps = 1000

    def build(self, world):
        pass

    def sample(self, world, rng):
        pass

    def reset_robots(self, world, rng):
        for name, placement in self.layout.items():
            world.stand(name, placement.start_qpos)

    def evaluate(self, state):
        return {"success": state.array(np.zeros(state.num_envs)) > 1}


def free_robots(layout: Layout, control_mode=None, num_envs: int = 1) -> FreeRobots:
    """Return the task with some robots."""
    return FreeRobots(
        replace(FreeRobots.scenario, layout=layout, control_mode=control_mode, num_envs=num_envs)
    )


def swing(layout: Layout, seconds: float = 1.5, far: float = 0.4) -> Motion:
    """Return a motion in which every joint of the arms turns by up to ``far`` (rad)."""
    share = np.linspace(0, 1, round(seconds / 0.02) + 1)
    course = share**3 * (10 - 15 * share + 6 * share**2)
    slope = 30 * share**2 * (1 - share) ** 2 / seconds
    positions, velocities = {}, {}
    for name, placement in layout.items():
        robot = placement.robot
        joints = [robot.joints.index(joint) for joint in robot.arm_joints]
        way = np.zeros(robot.dof)
        way[joints] = far * np.cos(np.arange(len(joints)) + 1.0)
        positions[name] = placement.start_qpos + course[:, None] * way
        velocities[name] = slope[:, None] * way
    return Motion(layout, seconds * share, positions, velocities)
