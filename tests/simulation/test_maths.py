"""Shortcuts of `robot_layouts.simulation.maths` give the bits of what they stand for."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from robot_layouts.simulation.maths import (
    added,
    arccos,
    arctan2,
    closeness,
    cos,
    exp,
    log,
    norm,
    sin,
    sqrt,
    tanh,
)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("shape", [(1,), (3, 1), (3, 5), (2, 40)])
def test_closeness_is_one_less_the_hyperbolic_tangent(shape, dtype):
    x = np.random.default_rng(0).uniform(0, 2, shape).astype(dtype)
    exact = 1.0 - torch.from_numpy(x * 5.0).tanh().numpy()
    close = closeness(x, 5.0)
    assert close.dtype == dtype
    assert close.tobytes() == exact.tobytes()
    assert torch.equal(closeness(torch.from_numpy(x), 5.0), torch.from_numpy(exact))


@pytest.mark.parametrize("function", [arccos, cos, exp, log, sin, sqrt, tanh])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_functions_of_each_number_are_torchs_and_leave_their_argument_as_it_is(function, dtype):
    x = np.random.default_rng(0).uniform(0, 1, (30, 40)).astype(dtype)
    before = x.copy()
    torchs = getattr(torch, function.__name__)
    for rows in (x, x[:1, 0], x[0], x[:, 0], x[:, ::2], x.T):
        ours = function(rows)
        assert ours.dtype == dtype
        np.testing.assert_array_equal(ours, torchs(torch.from_numpy(rows)).numpy())
    np.testing.assert_array_equal(x, before)
    whole = np.ones(2, int)
    np.testing.assert_array_equal(function(whole), torchs(torch.from_numpy(whole)).numpy())


@pytest.mark.parametrize("count", [1, 2, 9])
def test_four_are_added_one_after_the_other(count):
    x = np.random.default_rng(0).normal(size=(count, 4, 4)).astype(np.float32)
    one_by_one = x[:, 0] + x[:, 1] + x[:, 2] + x[:, 3]
    np.testing.assert_array_equal(added(x), one_by_one)
    np.testing.assert_array_equal(added(torch.from_numpy(x)).numpy(), one_by_one)
    assert not np.array_equal(x[:, 3] + x[:, 2] + x[:, 1] + x[:, 0], one_by_one)


def test_arc_tangents_are_those_of_single_numbers():
    y, x = np.random.default_rng(0).normal(size=(2, 40)).astype(np.float32)
    single = [torch.atan2(*pair) for pair in zip(*map(torch.from_numpy, (y, x)), strict=True)]
    before = y.copy()
    np.testing.assert_array_equal(arctan2(y, x), torch.stack(single).numpy())
    np.testing.assert_array_equal(y, before)


def test_norms_of_chosen_columns_are_those_of_single_rows():
    rows = np.random.default_rng(0).normal(size=(500, 15)).astype(np.float32)
    chosen = [3, 1, 0, 2, 4, 9, 8, 7, 6, 5, 10, 11, 14]
    single = [norm(rows[i : i + 1, chosen])[0] for i in range(len(rows))]
    np.testing.assert_array_equal(norm(rows[:, chosen]), single)
