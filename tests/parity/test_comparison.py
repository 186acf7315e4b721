"""The arithmetic of the comparison, on small made-up sides; nothing native is needed."""

import numpy as np
import pytest

from parity.lockstep import QUANTITIES, compare, differing, largest_difference
from robots import TaskError
from tasks.episode import Episode

COUNTER = ("qpos", "counter")


class Counter:
    """A side whose only state counts steps, and which may be told to lie."""

    def __init__(self, num_envs=1, action_dim=2, lie=None):
        self.num_envs, self.action_dim = num_envs, action_dim
        self.lie = lie or (lambda snapshot, step: snapshot)
        self.resets, self.actions = [], []

    def reset(self, seeds, env_ids, *, rebuild):
        self.resets.append((list(seeds), list(env_ids), rebuild))
        self.time = 0
        return self.lie({COUNTER: np.zeros((len(env_ids), 1))}, 0)

    def step(self, actions):
        self.actions.append(actions.copy())
        self.time += 1
        count = np.full((self.num_envs, 1), float(self.time))
        return self.lie({COUNTER: count, ("info", "success"): count[:, 0] > 2}, self.time)

    def touching(self):
        return np.arange(self.num_envs) % 2 == 0


def episode(seed=0, steps=4):
    return Episode(seed, np.full((steps, 2), seed + 1, np.float32))


def lying(key, row, value, at=3):
    """A lie about one number from step ``at`` on."""

    def lie(snapshot, step):
        if step >= at:
            snapshot[key] = snapshot[key].copy()
            snapshot[key][row] = value
        return snapshot

    return lie


def test_equal_sides():
    (result,) = compare(Counter(), Counter(), [episode(7)])
    assert result.equal
    assert (result.seed, result.steps, result.contact_steps) == (7, 4, 4)
    assert (result.native_success, result.our_success) == (True, True)
    assert result.max_difference == dict.fromkeys(QUANTITIES, 0.0)


def test_first_difference_and_largest():
    lie = lying(COUNTER, 0, 3.5)
    (result,) = compare(Counter(), Counter(lie=lie), [episode()])
    assert not result.equal
    assert str(result.first_difference) == "from step 3 in qpos of counter"
    assert result.max_difference["qpos"] == 0.5
    assert sum(result.max_difference.values()) == 0.5


def test_difference_at_the_reset():
    (result,) = compare(Counter(), Counter(lie=lying(COUNTER, 0, 1e-30, at=0)), [episode()])
    assert str(result.first_difference) == "at the reset in qpos of counter"


def test_success_of_each_side():
    lie = lying(("info", "success"), 0, False, at=1)
    (result,) = compare(Counter(), Counter(lie=lie), [episode()])
    assert (result.native_success, result.our_success) == (True, False)
    assert result.max_difference["info"] == 1.0


@pytest.mark.parametrize("missing_in_native", [True, False])
def test_a_missing_entry(missing_in_native):
    def drop(snapshot, step):
        if step == 2:
            del snapshot["info", "success"]
        return snapshot

    honest, dropping = Counter(), Counter(lie=drop)
    sides = (dropping, honest) if missing_in_native else (honest, dropping)
    (result,) = compare(*sides, [episode()])
    assert str(result.first_difference) == "from step 2 in info of success"
    assert result.max_difference["info"] == np.inf


def test_another_shape():
    def widen(snapshot, step):
        return {key: np.repeat(v, 2, axis=-1) if v.ndim == 2 else v for key, v in snapshot.items()}

    (result,) = compare(Counter(), Counter(lie=widen), [episode()])
    assert result.max_difference["qpos"] == np.inf


def test_batches():
    """Seven episodes in batches of three; each with its own actions and its own row."""
    first, second = Counter(3), Counter(3, lie=lying(COUNTER, 1, -1.0))
    episodes = [episode(seed, steps=3 + seed % 2) for seed in range(7)]
    results = list(compare(first, second, episodes, history="reused"))
    assert [result.seed for result in results] == list(range(7))
    assert [result.steps for result in results] == [3, 4, 3, 4, 3, 4, 3]
    assert [result.equal for result in results] == [seed % 3 != 1 for seed in range(7)]
    assert first.resets == [
        ([0, 1, 2], [0, 1, 2], False),
        ([3, 4, 5], [0, 1, 2], False),
        ([6], [0], False),
    ]
    np.testing.assert_array_equal(first.actions[0], [[1, 1], [2, 2], [3, 3]])
    np.testing.assert_array_equal(first.actions[3], [[0, 0], [2, 2], [0, 0]])  # 0 and 2 are over
    assert [result.contact_steps for result in results] == [3, 0, 3, 4, 0, 4, 3]


def test_an_episode_is_not_judged_after_its_end():
    lie = lying(COUNTER, 0, -1.0, at=3)
    results = list(compare(Counter(2), Counter(2, lie=lie), [episode(0, 2), episode(1, 9)]))
    assert [result.equal for result in results] == [True, True]


def test_history_decides_on_rebuilding():
    for history, rebuild in (("fresh", True), ("reused", False)):
        first, second = Counter(), Counter()
        list(compare(first, second, [episode()], history=history))
        assert first.resets == second.resets == [([0], [0], rebuild)]


def test_sides_of_different_size_are_refused():
    with pytest.raises(TaskError, match=r"2 action numbers.* 3"):
        list(compare(Counter(), Counter(action_dim=3), [episode()]))


def test_steps_are_counted_while_playing():
    advanced = []
    list(compare(Counter(2), Counter(2), [episode(0, 2), episode(1, 3)], on_step=advanced.append))
    assert advanced == [2, 2, 1]


@pytest.mark.parametrize(
    ("a", "b", "expected"),
    [
        ([1.0, 2.0], [1.0, 2.0], 0.0),
        ([1.0], [np.nextafter(1.0, 2.0)], np.spacing(1.0)),
        ([np.nan, 1.0], [np.nan, 1.0], 0.0),
        ([np.nan], [0.0], np.inf),
        ([np.inf], [np.inf], 0.0),
        ([np.inf], [1.0], np.inf),
        ([True, False], [True, True], 1.0),
        ([1.0], [1.0, 1.0], np.inf),
        ([], [], 0.0),
    ],
)
def test_largest_difference(a, b, expected):
    assert largest_difference(np.array(a), np.array(b)) == expected


def test_differing_names_what_only_one_side_has():
    same, other = np.zeros(2), np.ones(2)
    first = {("info", "a"): same, ("info", "b"): same, ("info", "c"): same}
    second = {("info", "a"): same.copy(), ("info", "b"): other, ("info", "d"): same}
    assert differing(first, second) == [("info", "b"), ("info", "c"), ("info", "d")]
