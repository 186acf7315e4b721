"""What ManiSkill's tasks do otherwise than a task needs to, so that a clone must do it too."""

from __future__ import annotations

from typing import ClassVar

from tasks import EpisodeRandom, MultiRobotTask, World


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
