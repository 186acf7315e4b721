import pytest
import torch

import tasks
from robot_layouts.simulation.sapien3.backend import worlds_below
from tasks.maniskill.peg_insertion_side import HALF_LENGTH, RADIUS, PegDesign


def designs(env: tasks.MultiRobotTask) -> list[PegDesign]:
    return [world.design for world in env.simulation.worlds]


@pytest.mark.parametrize("options", [None, {"reconfigure": True}])
def test_every_reset_draws_a_new_peg(options: dict[str, bool] | None):
    env = tasks.make("PegInsertionSide-v1")
    seen = set()
    for seed in (3, None, None, 4):
        _, info = env.reset(seed=seed, options=options)
        assert info["reconfigure"] is True
        seen.update(designs(env))
    assert len(seen) == 4
    for design in seen:
        assert HALF_LENGTH[0] <= design.half_length <= HALF_LENGTH[1]
        assert RADIUS[0] <= design.radius <= RADIUS[1]
        assert max(map(abs, design.hole_centre)) <= 0.5 * (design.half_length - design.radius)


def test_what_is_built_and_what_is_observed_are_the_design():
    env = tasks.make("PegInsertionSide-v1", num_envs=2)
    obs, _ = env.reset(seed=1)
    half_sizes = obs[:, env.observation_slices["peg_half_size"]]
    assert not torch.equal(half_sizes[0], half_sizes[1])
    below = worlds_below(env.simulation)
    for world, built, observed in zip(env.simulation.worlds, below, half_sizes, strict=True):
        (shape,) = built.bodies["peg"].component.collision_shapes
        assert shape.half_size.tolist() == observed.tolist()
        assert observed[0].item() == pytest.approx(world.design.half_length)
        assert len(built.bodies["box_with_hole"].component.collision_shapes) == 4


def test_a_seed_gives_the_same_peg_again():
    env = tasks.make("PegInsertionSide-v1")
    env.reset(seed=6)
    (first,), second = designs(env), (env.reset(), designs(env)[0])[1]
    env.reset(seed=6)
    assert designs(env) == [first]
    env.reset()
    assert designs(env) == [second]
