"""What lives below the seam stays there, and what is above asks for it in batched verbs."""

from __future__ import annotations

import dataclasses
import re
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest
import torch

import tasks
from layouts import single
from robot_layouts.simulation.backend import SIMULATORS, Backend, open_backend
from robot_layouts.simulation.sapien3.backend import SapienBackend
from robots import RobotDescriptor, RobotRegistry, UnknownNameError
from tests.quick import quick_cases

VERBS = [name for name in vars(Backend) if not name.startswith("_")]
TASKS = ("PickCube-v1", "TwoRobotPickCube-v1", "PushT-v1", "PegInsertionSide-v1", "Relay-v1")


def reached(start: Any) -> Iterator[tuple[str, Any]]:
    """Yield whatever is reached from an object by public attributes, items and keys."""
    seen: dict[int, Any] = {}  # which keeps what is made on the way, so that ids stay its own
    found = [(type(start).__name__, start)]
    while found:
        path, thing = found.pop()
        if id(thing) in seen or isinstance(thing, str | bytes | int | float | np.ndarray):
            continue
        seen[id(thing)] = thing
        yield path, thing
        if isinstance(thing, Mapping):
            found += [(f"{path}[{key!r}]", value) for key, value in thing.items()]
        elif isinstance(thing, list | tuple | set | frozenset):
            found += [(f"{path}[{i}]", value) for i, value in enumerate(thing)]
        if re.match(r"(robot_layouts\.simulation\.(?!sapien3)|tasks\.)", type(thing).__module__):
            found += list(attributes(path, thing))


def attributes(path: str, thing: Any) -> Iterator[tuple[str, Any]]:
    for name in dir(thing):
        if not name.startswith("_"):
            value = getattr(thing, name)
            yield f"{path}.{name}", getattr(value, "__self__", value)


def of_sapien(start: Any) -> list[str]:
    return [path for path, x in reached(start) if type(x).__module__.split(".")[0] == "sapien"]


@pytest.fixture(params=TASKS)
def env(request):
    with_two = tasks.make(request.param, num_envs=2)
    with_two.reset(seed=0)
    with_two.step(np.zeros(with_two.action_space.shape, np.float32))
    yield with_two
    with_two.close()


def test_nothing_of_sapien_is_reached_above_the_seam(env):
    for start in (env.simulation, env.simulation.worlds[0], env.simulation.read(), env):
        assert of_sapien(start) == []


class Verbs:
    """A backend of which only the verbs are there, and whose calls are counted."""

    def __init__(self) -> None:
        self._sapien = SapienBackend()
        self.calls: Counter[str] = Counter()

    def __getattr__(self, verb: str) -> Any:
        if verb not in VERBS:
            raise AttributeError(f"the seam has no verb {verb!r}")
        self.calls[verb] += 1
        return getattr(self._sapien, verb)


def calls(monkeypatch: pytest.MonkeyPatch, task_id: str, num_envs: int) -> list[Counter[str]]:
    """Return how often each verb is called by a reset, a step and what keeps states."""
    made: list[Verbs] = []

    def backend() -> Verbs:
        made.append(Verbs())
        return made[-1]

    monkeypatch.setattr("robot_layouts.simulation.simulation.open_backend", lambda _: backend())
    env = tasks.make(task_id, num_envs=num_envs)
    action = torch.zeros(env.action_space.shape)
    env.step(action)
    counted: list[Counter[str]] = []
    tape = env.begin_tape()
    for do in (
        lambda: env.reset(seed=1),
        lambda: env.step(action),
        lambda: env.write_tape(tape),
        lambda: env.set_state_dict(env.get_state_dict()),
        lambda: env.reset(seed=1, options={"reconfigure": True}),
    ):
        made[0].calls.clear()
        do()
        counted.append(made[0].calls.copy())
    env.close()
    return counted


@pytest.mark.parametrize("task_id", quick_cases(tasks.list_tasks()))
def test_a_task_needs_the_verbs_alone_and_as_many_calls_for_many_worlds_as_for_one(
    task_id, monkeypatch
):
    one, several = (calls(monkeypatch, task_id, count) for count in (1, 3))
    assert one == several
    reset, step, *_ = one
    assert reset["clear"] == 1
    assert reset["place"] == 1
    assert step["drive"] == step["step"] == 1


def backwards(robot: RobotDescriptor) -> RobotDescriptor:
    """Return a Panda that declares its arm's joints from the hand to the base."""
    arm = robot.action_split.groups["arm"]
    return dataclasses.replace(
        robot,
        action_split=robot.action_split.replace(
            arm=dataclasses.replace(arm, joints=arm.joints[::-1])
        ),
        keyframes={name: (*q[6::-1], *q[7:]) for name, q in robot.keyframes.items()},
    )


def test_joints_are_in_the_descriptors_order_above_and_in_natives_at_the_border():
    panda = RobotRegistry.load("panda")
    layouts = [single({"arm": robot}) for robot in (panda, backwards(panda))]
    envs = [tasks.make("PickCube-v1", layout=layout) for layout in layouts]
    state = envs[0].get_state_dict()
    state["articulations"]["panda"][0, 13:] += torch.arange(18) / 1000
    for env in envs:
        env.set_state_dict(state)
    own, other = (env.simulation.read() for env in envs)
    order = [*range(6, -1, -1), 7, 8]
    np.testing.assert_array_equal(own.qpos("arm")[:, order], other.qpos("arm"))
    np.testing.assert_array_equal(own.qvel("arm")[:, order], other.qvel("arm"))
    np.testing.assert_array_equal(own.all_poses, other.all_poses)
    for tapes in zip(*(taped(env) for env in envs), strict=True):
        np.testing.assert_array_equal(*tapes)
    rows = [env.get_state_dict()["articulations"]["panda"] for env in envs]
    assert torch.equal(*rows)
    assert torch.equal(rows[0][0, 13:], state["articulations"]["panda"][0, 13:])
    action = torch.linspace(-1, 1, 8)[None]
    seen = [envs[0].step(action)[0], envs[1].step(action[:, [*range(6, -1, -1), 7]])[0]]
    assert torch.equal(*seen)


def taped(env: tasks.MultiRobotTask) -> list[np.ndarray]:
    tape = env.begin_tape()
    env.write_tape(tape)
    return [rows for group in tape.read().values() for rows in group.values()]


def test_a_task_is_stepped_by_the_simulator_that_it_names(monkeypatch):
    class Other(SapienBackend):
        """SAPIEN under another name."""

    monkeypatch.setattr("robot_layouts.simulation.sapien3.backend.Other", Other, raising=False)
    monkeypatch.setitem(SIMULATORS, "other", "robot_layouts.simulation.sapien3.backend:Other")
    env = tasks.make("PushCube-v1", simulator="other")
    assert type(env.simulation.backend) is Other
    with pytest.raises(UnknownNameError, match="Did you mean 'sapien3'"):
        open_backend("sapien")
