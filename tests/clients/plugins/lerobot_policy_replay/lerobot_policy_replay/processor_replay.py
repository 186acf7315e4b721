"""Nothing is done to observations and actions."""

from lerobot.processor import PolicyProcessorPipeline
from lerobot.processor.converters import policy_action_to_transition, transition_to_policy_action


def make_replay_pre_post_processors(config, dataset_stats=None):
    """Return the pipelines of observations and of actions."""
    return PolicyProcessorPipeline(steps=[]), PolicyProcessorPipeline(
        steps=[],
        to_transition=policy_action_to_transition,
        to_output=transition_to_policy_action,
    )
