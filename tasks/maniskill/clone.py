"""What ManiSkill's tasks do otherwise than a task needs to, so that a clone must do it too."""

from __future__ import annotations

from math import inf
from typing import Any, ClassVar

from tasks import EpisodeRandom, MultiRobotTask, State, World
from tasks.maths import Flags, Floats, like, norm, stack


class Clone(MultiRobotTask):
    """A clone of one of ManiSkill's tasks (mani_skill 3.0.1).

    Attributes:
        first_seed: Native seeds environment i with 2022 + i when it is made (`BaseEnv.__init__`).
        joint_noise_draws: How often joint noise is drawn at a reset; the last draw counts. Native
            draws once in its table scene, and some tasks draw again.
        shared_joint_noise: Whether all robots get the same joint noise, as where native's table
            scene draws once for two arms.
    """

    first_seed = 2022
    joint_noise_draws: ClassVar[int] = 1
    shared_joint_noise: ClassVar[bool] = False

    def reset_robots(self, world: World, rng: EpisodeRandom) -> None:
        """Stand every robot at its placement, with the joint noise that native draws."""
        for _ in range(self.joint_noise_draws - 1):
            rng.joint_noise(world.layout, shared=self.shared_joint_noise)
        for name, noise in rng.joint_noise(world.layout, shared=self.shared_joint_noise).items():
            self.stand(world, name, noise)

    def agent_tcp_pose(self, state: State, robot: str) -> Floats:
        """Return native's ``agent.tcp_pose``, (N, 7): ``agent.tcp.pose``, unless it has its own."""
        links = self.layout.arm(robot).robot.native_agent.tcp_links
        if not links:
            return state.tcp_pose(robot)
        total: Any = sum(state.link_pose(robot, link) for link in links)
        return total / len(links)

    def agent_tip_positions(self, state: State, robot: str) -> Floats:
        """Return where a robot's tips are, (N, tips, 3) (m): its TCP if native's agent has none."""
        links = self.layout.arm(robot).robot.native_agent.tip_links
        tips = [state.link_position(robot, link) for link in links]
        return stack(tips or [state.tcp_position(robot)], 1)

    def agent_is_static(self, state: State, robot: str, threshold: float) -> Flags:
        """Return native's ``agent.is_static(threshold)``, (N,) bool (rad/s)."""
        descriptor = self.layout.arm(robot).robot
        agent = descriptor.native_agent
        if not agent.base_joints:
            return state.is_static(robot, threshold)
        limits = dict.fromkeys(descriptor.joints, threshold)
        limits |= dict.fromkeys(agent.base_joints, agent.base_speed)
        limits |= dict.fromkeys(descriptor.gripper_joints, inf)
        qvel = state.qvel(robot)
        return (qvel <= like(qvel, list(limits.values()))).all(1)

    def agent_speed(self, state: State, robot: str, *, fingers: bool) -> Floats:
        """Return the norm of native's joint velocities, (N,) (rad/s).

        Args:
            state: The state.
            robot: Name of the robot.
            fingers: Whether those of a gripper count where the robot has a base.
        """
        descriptor = self.layout.arm(robot).robot
        if not descriptor.native_agent.base_joints:
            return state.arm_speed(robot)
        order = self.simulation.index.loaded_order[robot] or range(descriptor.dof)  # native's
        grips = () if fingers else descriptor.gripper_joints
        counted = [i for i in order if descriptor.joints[i] not in grips]
        return norm(state.qvel(robot)[:, counted])
