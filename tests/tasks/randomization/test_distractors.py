"""Distractors: where they stand, what they are made of, and whom they leave alone."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

import tasks
from robot_layouts.simulation.sapien3.backend import worlds_below
from robot_layouts.simulation.world import Part
from robots import TaskError, UnknownNameError
from tasks import Camera, Distractors, Randomization, TaskEnv, Uniform, Whole

NAMES = [f"distractor_{i}" for i in range(4)]
SOME = Distractors(count=Whole(0, 4))
ALL = Distractors(count=Whole(4, 4))


def made(distractors: Distractors | None, num_envs: int = 1, **options: Any) -> TaskEnv:
    randomization = Randomization(distractors=distractors)
    return tasks.make("PickCube-v1", num_envs, randomization=randomization, **options)


def drawn(env: TaskEnv, i: int = 0) -> dict[str, Any]:
    about = env.drawn(i)
    assert about is not None
    return about["distractors"]


def test_they_stand_clear_of_everything_and_rest() -> None:
    env = made(SOME, 2)
    counts: set[int] = set()
    for seed in range(0, 20, 2):
        env.reset(seed=seed)
        before = env.simulation.read()
        for i in range(2):
            about, boxes = drawn(env, i), env.simulation.backend.extents(i)
            there = [name for name in NAMES if about[name]["there"]]
            counts.add(about["count"])
            assert len(there) == about["count"]
            for name in there:
                low, high = boxes.pop(Part(None, name))
                assert low[2] == pytest.approx(0.0, abs=1e-5)
                for part, (lowest, highest) in boxes.items():
                    apart = (lowest - high > 0.015) | (low - highest > 0.015)
                    assert apart.any() or part.name == "table-workspace", (name, part)
                goal = before.position("goal_site")[i]
                middle = before.position(name)[i]
                assert np.linalg.norm(goal - middle) > 0.03
        for _ in range(5):
            env.step(np.zeros((2, 8), np.float32))
        after = env.simulation.read()
        for name in NAMES:
            np.testing.assert_allclose(after.position(name), before.position(name), atol=2e-3)
    assert len(counts) > 3


def test_goals_are_spared() -> None:
    """The region on the table that a cube is pushed to, 0.1 m in radius, touches nothing."""
    nearby = Distractors(count=Whole(3, 3), x=Uniform(-0.1, 0.3), y=Uniform(-0.3, 0.3))
    env = tasks.make("PushCube-v1", randomization=Randomization(distractors=nearby))
    for seed in range(8):
        env.reset(seed=seed)
        state = env.simulation.read()
        goal = state.position("goal_region")[0, :2]
        ways = [state.position(name)[0, :2] - goal for name in NAMES[:3]]
        assert min(map(np.linalg.norm, ways)) > 0.12
        assert drawn(env)["count"] > 1


def test_a_seed_brings_them_back_in_a_world_used_again_or_rebuilt() -> None:
    env, batch = made(SOME), made(SOME, 2)
    env.reset(seed=1)
    first, poses = drawn(env), env.simulation.read().all_poses.copy()
    env.reset(seed=2)
    assert drawn(env) != first
    for options in ({}, {"reconfigure": True}):
        env.reset(seed=1, options=options)
        assert drawn(env) == first
        assert np.array_equal(env.simulation.read().all_poses, poses)
    _, info = batch.reset(seed=1)
    assert drawn(batch) == first
    assert info["drawn/distractors/count"].tolist() == [drawn(batch, i)["count"] for i in (0, 1)]


def fall(kind: str) -> float:
    """Drop the cube on a distractor, and return the height at which it comes to rest (m)."""
    box = Distractors(
        count=Whole(1, 1),
        kind=kind,  # pyright: ignore[reportArgumentType]
        shapes=["box"],
        size=0.03,
        x=0.1,
        y=0.25,
        yaw=0.0,
    )
    env = made(box)
    env.reset(seed=0)
    middle = env.simulation.read().position("distractor_0")[0]
    state = env.get_state_dict()
    assert ("distractor_0" in state["actors"]) == (kind == "dynamic")
    state["actors"]["cube"][0, :7] = torch.tensor([*middle[:2], 0.15, 1.0, 0.0, 0.0, 0.0])
    env.set_state_dict(state)
    for _ in range(20):
        env.step(np.zeros((1, 8), np.float32))
    return float(env.simulation.read().position("cube")[0, 2])


def test_real_ones_bear_a_cube_and_others_do_not() -> None:
    assert fall("dynamic") > 0.04
    assert fall("static") > 0.04
    assert fall("visual") == pytest.approx(0.02, abs=1e-3)


def test_those_that_are_seen_alone_change_no_state() -> None:
    def played(distractors: Distractors | None) -> list[torch.Tensor]:
        env = made(distractors)
        env.reset(seed=3, options={"reconfigure": True})
        rng, rows = np.random.default_rng(0), list[torch.Tensor]()
        for _ in range(8):
            env.step(rng.uniform(-1, 1, (1, 8)).astype(np.float32))
            rows += [x for part in env.get_state_dict().values() for x in part.values()]
        return rows

    unseen = Distractors(count=Whole(3, 3), kind="visual")
    pairs = zip(played(None), played(unseen), strict=True)
    assert all(torch.equal(before, after) for before, after in pairs)


def test_what_finds_no_place_is_left_out() -> None:
    env = made(Distractors(count=Whole(3, 3), x=0.1, y=0.25))
    env.reset(seed=0)
    assert drawn(env)["count"] == 1
    assert env.simulation.read().position("distractor_1")[0, 2] > 900


@pytest.mark.usefixtures("renderer")
def test_cameras_see_those_that_are_there() -> None:
    camera = Camera((0.4, 0.0, 0.9), (0.0, 0.0, 0.0), width=128, height=128)
    env = made(SOME, obs_mode="rgb+segmentation", cameras=[camera])
    numbers = {n: worlds_below(env.simulation)[0].bodies[n].entity.per_scene_id for n in NAMES}
    for seed in range(4):
        obs, _ = env.reset(seed=seed)
        data = obs["sensor_data"]["base_camera"]
        for name, number in numbers.items():
            pixels = data["rgb"][0][data["segmentation"][0, ..., 0] == number].numpy()
            there = drawn(env)[name]["there"]
            assert bool(len(pixels)) == bool(there)
            if there:
                strongest = max(("red", "green", "blue"), key=lambda c: drawn(env)[name][c])
                assert ("red", "green", "blue")[int(pixels.mean(0).argmax())] == strongest


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda: Distractors(count=Uniform(0, 2)), "Whole"),
        (lambda: Distractors(count=Whole(0, 3), bodies=2), "bodies is 2"),
        (lambda: Distractors(count=Whole(0, 3), shapes=["cube"]), "box"),
        (lambda: Distractors(count=Whole(0, 3), kind="solid"), "static"),  # pyright: ignore[reportArgumentType]
        (lambda: Distractors(count=Whole(0, 3), gap=-1.0), "gap"),
        (lambda: Randomization.from_json({"distractors": {"cout": 3}}), "count"),
        (lambda: Randomization.from_json({"distractors": {}}), "distractors lacks count; it takes"),
    ],
)
def test_what_cannot_be_is_refused(wrong: Callable[[], Any], message: str) -> None:
    with pytest.raises((TaskError, UnknownNameError), match=message):
        wrong()


def test_they_are_written_and_read() -> None:
    for distractors in (SOME, ALL, Distractors(count=Whole(0, 2), bodies=6, kind="static", x=0.1)):
        declared = Randomization(distractors=distractors)
        assert Randomization.from_json(declared.to_json()) == declared
    floats = {"count": {"whole": [0.0, 2.0]}, "bodies": 4.0}  # as files have them
    read = Randomization.from_json({"distractors": floats})
    assert read == Randomization(distractors=Distractors(count=Whole(0, 2), bodies=4))
