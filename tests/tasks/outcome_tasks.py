"""Tasks that can be lost, or are never solved."""

import layouts
from tasks import Area, Goal, MultiRobotTask
from tasks.maths import norm


class KeepAway(MultiRobotTask):
    """Raise the TCP, and keep away from the ball. Success: 30 cm high."""

    layout = layouts.single({"arm": "panda"})
    max_episode_steps = 30

    ball = Goal(0.03, spawn=Area(x=-0.03, y=0.04, z=0.06))

    def evaluate(self, state):
        high = state.tcp_position("arm")[:, 2] >= 0.3
        return {"success": high, "fail": self.near(state) <= 0.06}

    def dense_reward(self, state, action, info):
        return self.near(state)

    def near(self, state):
        return norm(state.tcp_offset("arm", "ball"))


class Doodle(MultiRobotTask):
    """Move as you like."""

    layout = layouts.single({"arm": "panda"})
    max_episode_steps = 5
    control_frequency = 10
    open_ended = True

    def evaluate(self, state):
        return {"height": state.tcp_position("arm")[:, 2]}
