"""What the policy is made with; LeRobot finds the other modules by this one's name."""

from dataclasses import dataclass

from lerobot.configs import PreTrainedConfig


@PreTrainedConfig.register_subclass("replay")
@dataclass
class ReplayConfig(PreTrainedConfig):
    """Which recordings it remembers.

    Attributes:
        plans: An npz file: ``start/K``, what was observed of bodies at first, and ``actions/K``.
    """

    plans: str = ""

    @property
    def observation_delta_indices(self) -> None:
        return None

    @property
    def action_delta_indices(self) -> None:
        return None

    @property
    def reward_delta_indices(self) -> None:
        return None

    def get_optimizer_preset(self):
        raise NotImplementedError("nothing is learnt")

    def get_scheduler_preset(self) -> None:
        return None

    def validate_features(self) -> None:
        assert self.output_features
