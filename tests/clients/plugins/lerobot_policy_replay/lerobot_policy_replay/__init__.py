"""A policy of LeRobot that remembers recordings: ``--policy.type=replay``."""

from lerobot_policy_replay.configuration_replay import ReplayConfig

__all__ = ["ReplayConfig"]
