"""A seed places everything where native places it."""

from collections.abc import Iterable

import numpy as np
import pytest

from parity.lockstep import differing
from tests.native import NATIVE, TASKS, Pair, pair

pytestmark = [*NATIVE, pytest.mark.long]

# Tasks whose joint noise is not drawn from the stream that goes on without a seed, and why.
NO_NOISE = {"DrawTriangle-v1": "native starts it without joint noise"}
OTHER_NOISE = {"PlugCharger-v1": "native draws its joint noise from torch's global stream"}
NOISY = [task_id for task_id in TASKS if task_id not in NO_NOISE | OTHER_NOISE]


def expect_equal_resets(both: Pair, seeds: Iterable[int]) -> None:
    both.forget()
    for seed in seeds:
        native, ours = (side.reset([seed], [0], rebuild=False) for side in both)
        assert differing(native, ours) == [], f"seed {seed}"


@pytest.mark.parametrize("task_id", TASKS)
def test_thousand_seeds_and_the_largest(task_id):
    expect_equal_resets(pair(task_id), [*range(1000), 2**31 - 1, 2**32 - 1])


@pytest.mark.parametrize("task_id", TASKS)
def test_seeds_differ_from_each_other(task_id):
    """So that the tests above compare many resets and not one."""
    ours = pair(task_id).ours
    first, second = (ours.reset([seed], [0], rebuild=False) for seed in (0, 1))
    expected = {"object pose", "observation"} | (set() if task_id in NO_NOISE else {"qpos"})
    assert expected <= {key[0] for key in differing(first, second)}


@pytest.mark.parametrize("task_id", NOISY)
def test_without_a_seed_joint_noise_goes_on(task_id):
    """Objects are left out: native draws theirs from torch's global stream, ours from its own."""
    both = pair(task_id)
    both.forget()
    native, ours = both.native.envs[0], both.ours.env
    rebuild = {"reconfigure": True}
    seen = set()
    for seed, options in ((5, {}), (None, {}), (None, rebuild), (None, {}), (None, rebuild)):
        native.reset(seed=seed, options=dict(options))
        ours.reset(seed=seed, options=options)
        rows = ours.get_state_dict()["articulations"]
        for name, row in native.get_state_dict()["articulations"].items():
            np.testing.assert_array_equal(rows[name].numpy(), row.numpy())
            seen.add(tuple(row[0].tolist()))
    assert len(seen) >= 5, "the noise stood still"
