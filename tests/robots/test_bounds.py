"""Checks of numbers that users give."""

import math
from fractions import Fraction

import numpy as np
import pytest
import torch

from robot_layouts.core.bounds import (
    checked_flag,
    checked_number,
    checked_numbers,
    checked_whole,
    shown,
)
from robots import TaskError


@pytest.mark.parametrize(
    "number",
    [1, 1.5, np.float32(1.5), np.int8(1), Fraction(3, 2), np.array(1.5), torch.tensor(1.5)],
)
def test_numbers_of_every_kind(number):
    assert checked_number("x", number, 0, 2, TaskError) == float(number)


@pytest.mark.parametrize(
    "number",
    [None, True, np.True_, "1", b"1", [1], np.array([1.0]), 1j, math.nan, math.inf, -1, 3, 10**400],
)
def test_what_is_no_number_between_bounds(number):
    with pytest.raises(TaskError, match="x is .*; it must be a number from 0 to 2 m"):
        checked_number("x", number, 0, 2, TaskError, "m")


@pytest.mark.parametrize("whole", [None, True, 1.0, "1", np.float64(1), 0, 4, [1]])
def test_what_is_no_whole_number(whole):
    with pytest.raises(TaskError, match="n is .*; it must be an integer from 1 to 3"):
        checked_whole("n", whole, 1, 3, TaskError)


def test_whole_numbers_and_flags_of_numpy_are_some():
    assert checked_whole("n", np.int32(2), 1, 3, TaskError) == 2
    assert checked_flag("f", np.False_, TaskError) is False


@pytest.mark.parametrize("flag", [None, 0, 1, "no", [], np.array([True])])
def test_what_is_no_flag(flag):
    with pytest.raises(TaskError, match="f is .*; it must be True or False"):
        checked_flag("f", flag, TaskError)


@pytest.mark.parametrize(
    ("numbers", "message"),
    [
        ("123", "takes 3 numbers"),
        ({1, 2, 3}, "takes 3 numbers"),
        ((0, 0, None), "takes 3 numbers"),
        ((0, 0, True), "takes 3 numbers"),
        ((0, 0), "takes 3 finite numbers, none beyond 10 m"),
        ((0, 0, 11), "none beyond 10 m"),
        (np.array([0, 0, math.nan]), "takes 3 finite numbers"),
    ],
)
def test_what_are_no_three_numbers(numbers, message):
    with pytest.raises(TaskError, match=message):
        checked_numbers("p", numbers, 3, 10, TaskError, "m")


def test_values_are_shown_shortly_and_without_addresses():
    assert shown(object()) == "<object>"
    assert len(shown("a" * 1000)) < 100
    assert len(shown(list(range(1000)))) < 100
