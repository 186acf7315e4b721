"""FourRobotStack: which cube lies on which, at the middle, at rest and let go."""

import pytest

import tasks
from robot_layouts.experts import find_expert
from tasks.originals.four_robot_stack import ORDER
from tests.tasks.own import make, put

TASK = "FourRobotStack-v1"
STACKED = {f"cube_{place}": (0.0, 0.0, 0.02 + 0.04 * level) for level, place in enumerate(ORDER)}


def test_stacked_in_order_is_success():
    told = put(make(TASK), **STACKED)
    assert told["success"].all()
    assert all(told[f"is_{place}_placed"].all() for place in ORDER)


@pytest.mark.parametrize(
    ("changes", "placed"),
    [
        ({"cube_south": (0.031, 0.0, 0.02)}, 0),
        ({"cube_north": (0.035, 0.0, 0.10)}, 2),
        ({"cube_west": (0.0, 0.0, 0.147)}, 3),
        ({"cube_west": (0.3, 0.0, 0.02)}, 3),
        ({"cube_east": STACKED["cube_north"], "cube_north": STACKED["cube_east"]}, 1),
    ],
)
def test_what_is_no_success(changes: dict[str, tuple[float, ...]], placed: int):
    told = put(make(TASK), **{**STACKED, **changes})
    assert not told["success"].any()
    assert [bool(told[f"is_{place}_placed"].all()) for place in ORDER] == (
        [True] * placed + [False] * (4 - placed)
    )


def test_a_cube_that_moves_is_no_success():
    env = make(TASK)
    put(env, **STACKED)
    state = env.get_state_dict()
    state["actors"]["cube_west"][:, 9] = 0.1
    env.set_state_dict(state)
    assert not env.evaluate(env.simulation.read())["success"].any()


@pytest.mark.long
def test_each_placed_cube_is_worth_one():
    env = tasks.make(TASK, reward_mode="dense")
    env.reset(0, options={"reconfigure": True})
    rewards, placed = [], []
    for action in find_expert(TASK)(env, 0):
        _, reward, terminated, _, info = env.step(action[None])
        rewards.append(float(reward[0]))
        placed.append(sum(bool(info[f"is_{place}_placed"][0]) for place in ORDER))
    assert terminated.all()
    assert rewards[-1] == 5.0
    assert set(placed) == {0, 1, 2, 3, 4}
    assert all(count <= reward < count + 0.95 * (4 - count) for count, reward in
               zip(placed[:-1], rewards[:-1], strict=True) if count < 4)  # fmt: skip


@pytest.mark.parametrize("seed", range(3))
def test_every_cube_starts_on_its_arms_side(seed: int):
    env = tasks.make(TASK)
    env.reset(seed)
    state = env.simulation.read()
    for place, (x, y) in ORDER.items():
        cube = state.position(f"cube_{place}")[0]
        assert 0.25 <= cube[0] * x + cube[1] * y <= 0.33
        assert state.tcp_position(place)[0][:2] @ (x, y) > 0.1
