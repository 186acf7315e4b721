"""Worlds that vary: what a seed brings back, and what stays as it was."""

import hashlib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch

import tasks
from robot_layouts.simulation.sapien3.backend import worlds_below
from tasks import LogUniform, Randomization, TaskEnv, Uniform
from tests.tasks.randomization.declarations import IN_PLACE, TASK, VARIED

REBUILT = {"reconfigure": True}


def made(randomization: Randomization | None, num_envs: int = 1) -> TaskEnv:
    return tasks.make(TASK, num_envs, randomization=randomization)


def digest(env: TaskEnv, steps: int = 8) -> list[str]:
    """Play random actions and return a hash of each environment's states and observations."""
    rng, hashes = np.random.default_rng(0), [hashlib.sha256() for _ in range(env.num_envs)]
    width = env.single_action_space.shape[0]
    for _ in range(steps):
        row = rng.uniform(-1, 1, width).astype(np.float32)
        obs, *_ = env.step(np.tile(row, (env.num_envs, 1)))
        for i, own in enumerate(hashes):
            own.update(obs[i].numpy().tobytes())
            for entries in env.get_state_dict().values():
                for rows in entries.values():
                    own.update(np.asarray(rows[i]).tobytes())
    return [own.hexdigest() for own in hashes]


def test_off_means_the_bits_of_before() -> None:
    plain = tasks.make(TASK)
    for off in (None, Randomization()):
        env = made(off)
        obs, info = env.reset(seed=3, options=REBUILT)
        before, expected = plain.reset(seed=3, options=REBUILT)
        assert torch.equal(obs, before)
        assert list(info) == list(expected)
        assert digest(env) == digest(plain)
        assert env.drawn() is None


def test_the_tasks_own_draws_stay_what_they_are() -> None:
    """Also where sizes and gravity rebuild the world, and where a reset has no seed."""
    env, plain = made(VARIED), made(None)
    for seed in (3, None, None):
        states = []
        for one in (env, plain):
            one.reset(seed=seed)
            state = one.simulation.read()
            goal, cube = state.pose("goal_site")[0], state.pose("cube")[0]
            states.append([*state.joint_positions[0], *goal, *cube[:2], *cube[3:]])
        np.testing.assert_array_equal(*states)


def test_a_seed_brings_the_world_back() -> None:
    alone, many = made(VARIED), made(VARIED, 3)
    many.reset(seed=4, options=REBUILT)
    drawn, digests = [many.drawn(i) for i in range(3)], digest(many)
    assert drawn[0] != drawn[1]
    for i in range(3):
        alone.reset(seed=4 + i, options=REBUILT)
        assert alone.drawn() == drawn[i]
        assert digest(alone) == [digests[i]]


def test_without_a_seed_another_world_is_drawn_and_the_same_ones_again() -> None:
    env = made(VARIED)
    env.reset(seed=4)
    drawn = [env.drawn()]
    for _ in range(2):
        env.reset()
        drawn.append(env.drawn())
    assert drawn[0] != drawn[1] != drawn[2]
    env.reset(seed=4)
    assert env.drawn() == drawn[0]
    env.reset()
    assert env.drawn() == drawn[1]


def test_info_tells_what_was_drawn() -> None:
    env = made(VARIED, 2)
    _, info = env.reset(seed=1)
    for i in range(2):
        drawn = env.drawn(i)
        assert drawn is not None
        assert float(info["drawn/mass/cube"][i]) == pytest.approx(drawn["mass"]["cube"])
        assert float(info["drawn/mass/left"][i]) == pytest.approx(drawn["mass"]["left"])


def test_another_target_leaves_the_draws_of_the_others() -> None:
    mass = {"cube": LogUniform(0.5, 2.0)}
    few, many = (
        made(Randomization(mass=mass)),
        made(replace(VARIED, mass={"*": Uniform(0.9, 1.1), **mass})),
    )
    few.reset(seed=9)
    many.reset(seed=9)
    one, other = few.drawn(), many.drawn()
    assert one is not None
    assert other is not None
    assert one["mass"].items() < other["mass"].items()
    assert set(other["mass"]) == {"cube", "left", "right"}


def physical(env: TaskEnv) -> dict[str, Any]:
    """Return the numbers of a world that may be varied, as SAPIEN has them."""
    (world,) = worlds_below(env.simulation)
    numbers: dict[str, Any] = {}
    components = {name: body.component for name, body in world.bodies.items()}
    for name, robot in world.robots.items():
        components.update({f"{name}.{link}": part for link, part in robot.links.items()})
        numbers[name] = [*robot.base_pose.p.tolist(), *robot.base_pose.q.tolist()]
        for joint in robot.joints:
            numbers[f"{name}.{joint.name}"] = joint.stiffness, joint.damping, joint.friction
    for name, component in components.items():
        heavy = hasattr(component, "mass")
        numbers[f"{name} mass"] = (component.mass, *component.inertia.tolist()) if heavy else ()
        numbers[f"{name} friction"] = [
            (shape.physical_material.static_friction, shape.physical_material.dynamic_friction)
            for shape in component.collision_shapes
        ]
    return numbers


def test_a_reset_begins_from_what_was_declared() -> None:
    """Whatever was drawn before, a world that is used again has what a fresh one has."""
    used, fresh, plain = made(IN_PLACE), made(IN_PLACE), made(None)
    for seed in (1, 2, 3):
        used.reset(seed=seed)
        fresh.reset(seed=seed, options=REBUILT)
        found = physical(used)
        assert found == physical(fresh)
        drawn, declared = used.drawn(), physical(plain)
        assert drawn is not None
        changed = {name for name, numbers in found.items() if numbers != declared[name]}
        assert {"left", "right", "cube mass", "left.panda_hand mass"} < changed
        assert not {"right.panda_hand mass", "table-workspace friction"} & changed
        ratio = found["cube mass"][0] / declared["cube mass"][0]
        assert ratio == pytest.approx(drawn["mass"]["cube"])


@pytest.mark.parametrize(
    ("mass", "hand"),
    [
        ({"left": 2.0, "left.panda_hand": 3.0}, 3.0),
        ({"left.panda_hand": 3.0, "left": 2.0}, 2.0),
        ({"left": 2.0, "left.panda_hand": 3.0, "*": 4.0}, 4.0),
        ({"*": 4.0, "left.*": 5.0}, 5.0),
        ({"left.panda_h*": 6.0}, 6.0),
    ],
)
def test_of_several_names_the_last_one_counts(mass: dict[str, float], hand: float) -> None:
    env, plain = made(Randomization.from_json({"mass": mass})), made(None)
    found, declared = (physical(one)["left.panda_hand mass"][0] for one in (env, plain))
    assert found / declared == pytest.approx(hand)


def test_other_environments_go_on_as_they_are() -> None:
    env, undisturbed = made(VARIED, 2), made(VARIED, 2)
    for one in (env, undisturbed):
        one.reset(seed=2, options=REBUILT)
    env.reset(seed=[40], env_ids=[1])
    assert env.drawn(0) == undisturbed.drawn(0)
    assert digest(env)[0] == digest(undisturbed)[0]
