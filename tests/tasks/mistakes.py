"""A task that is right, and ways to get one thing wrong in it.

The mistakes stand in `mistakes_declared`, `mistakes_returned` and `mistakes_placed`, each with the
message that its author gets.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from layouts import single
from tasks import Area, Cube, MultiRobotTask
from tasks.engine.declared import check_declaration

RIGHT = ("layout", "max_episode_steps", "cube", "evaluate", "observe", "dense_reward")
N = 2  # environments
ACTION = np.zeros((N, 8), np.float32)


class Tray(MultiRobotTask):
    """A task that is right."""

    layout = single({"arm": "panda"})
    max_episode_steps = 10
    cube = Cube(0.02, spawn=Area(x=(-0.1, 0.1), y=0.1))

    def evaluate(self, state):
        return {"success": state.position("cube")[:, 2] > 0.2}

    def observe(self, state, info):
        return {"cube_pose": state.pose("cube")}

    def dense_reward(self, state, action, info):
        return -state.tcp_distance("arm", "cube")


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Attributes:
        what: It, in words.
        members: What is wrong of a class that is right otherwise; what is None is left out.
        message: What it gives.
        steps: How many steps show it.
        fields: Of the scenario that it is made with.
    """

    what: str
    members: dict[str, Any]
    message: str
    steps: int = 0
    fields: dict[str, Any] = field(default_factory=dict)

    def make(self) -> None:
        """Make it: declare the task, make two environments, take steps, reset one."""
        right = {name: value for name, value in vars(Tray).items() if name in RIGHT}
        members = {k: v for k, v in {**right, **self.members}.items() if v is not None}
        cls = type("Tray", (MultiRobotTask,), members)
        check_declaration(cls)
        scenario = cls.scenario
        for name, value in {"num_envs": N, **self.fields}.items():
            setattr(scenario, name, value)
        env = cls(scenario)
        try:
            for _ in range(self.steps):
                env.step(ACTION)
            env.reset(env_ids=[1])
        finally:
            env.close()


def evaluating(returned: Callable[[Any], Any]) -> dict[str, Any]:
    return {"evaluate": lambda self, state: returned(state)}


def observing(returned: Callable[[Any], Any]) -> dict[str, Any]:
    return {"observe": lambda self, state, info: returned(state)}


def rewarding(returned: Callable[[Any], Any]) -> dict[str, Any]:
    return {"dense_reward": lambda self, state, action, info: returned(state)}


def sampling(place: Callable[[Any, Any], Any]) -> dict[str, Any]:
    return {"sample": lambda self, world, rng: place(world, rng)}


def building(build: Callable[[Any], Any]) -> dict[str, Any]:
    return {"build": lambda self, world: build(world)}


def remembering(returned: Callable[[Any], Any]) -> dict[str, Any]:
    return {"remember": lambda self, state: returned(state)}


def responding(respond: Callable[[Any, Any], Any]) -> dict[str, Any]:
    return {"respond": lambda self, state: respond(self, state)}


def success(state: Any) -> Any:
    return state.position("cube")[:, 2] > 0.2


def in_place(state: Any) -> Any:
    height = state.position("cube")[:, 2]
    height -= 0.2
    return height


def in_turn(first: Callable[..., Any], then: Callable[..., Any], calls: int = 3) -> Any:
    """One function for so many calls, another one after them."""
    left = [first] * calls

    def call(*arguments: Any) -> Any:
        return (left.pop() if left else then)(*arguments)

    return call
