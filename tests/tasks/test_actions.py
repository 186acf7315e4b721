import numpy as np
import pytest
import torch

from layouts import face_to_face, single
from robots import ActionError, UnknownNameError
from tasks.engine.actions import ActionReader

TWO = face_to_face({"left": "panda", "right": "panda_stick"}, spacing=1.5)


def test_a_flat_tensor_is_taken_in_declared_order():
    flat = torch.arange(30, dtype=torch.float32).reshape(2, 15) / 30
    assert np.array_equal(ActionReader(TWO, 2).read(flat), flat.numpy())


@pytest.mark.parametrize("order", [("left", "right"), ("right", "left")])
def test_a_mapping_means_the_same_whatever_its_order(order: tuple[str, str]):
    flat = np.random.RandomState(0).uniform(-1, 1, (3, 15)).astype(np.float32)
    parts = {name: flat[:, TWO.action_split[name]] for name in order}
    assert np.array_equal(ActionReader(TWO, 3).read(parts), flat)


def test_one_environment_may_leave_out_the_first_dimension():
    assert ActionReader(TWO, 1).read(np.zeros(15)).shape == (1, 15)
    parts = {"left": np.zeros(8), "right": np.zeros((1, 7))}
    assert ActionReader(TWO, 1).read(parts).shape == (1, 15)
    with pytest.raises(ActionError, match=r"shape \(15,\); it must be \(2, 15\)"):
        ActionReader(TWO, 2).read(np.zeros(15))


def test_float64_is_rounded_to_float32():
    read = ActionReader(TWO, 1).read(np.full(15, 0.1))
    assert read.dtype == np.float32
    assert read[0, 0] == np.float32(0.1)


def test_a_tensor_that_requires_grad_is_read():
    assert ActionReader(TWO, 1).read(torch.zeros(1, 15, requires_grad=True)).shape == (1, 15)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (
            np.zeros((1, 16)),
            r"shape \(1, 16\); it must be \(1, 15\).*15 = 8 \(left\) \+ 7 \(right\)",
        ),
        (np.zeros((1, 15), int), "dtype int64; it must be floating"),
        (np.zeros((1, 15), bool), "dtype bool"),
        ([[0.0], [0.0, 1.0]], "not an array of numbers"),
        (["a"] * 15, "must be floating"),
        ({"left": np.zeros(8)}, r"no numbers for \['right'\]"),
        ({"left": np.zeros(8), "right": np.zeros(8)}, r"'right' has shape \(1, 8\).*\(1, 7\)"),
    ],
)
def test_what_is_wrong_is_said(action: object, message: str):
    with pytest.raises(ActionError, match=message):
        ActionReader(TWO, 1).read(action)


def test_an_unknown_robot_gets_its_closest_match():
    with pytest.raises(UnknownNameError, match="Did you mean 'right'"):
        ActionReader(TWO, 1).read({"left": np.zeros(8), "rigth": np.zeros(7)})


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    ("column", "words"),
    [
        (2, r"number 2 \(arm.panda_joint3\) of robot 'left'"),
        (7, r"number 7 \(gripper\) of robot 'left'"),
        (8, r"number 0 \(arm.panda_joint1\) of robot 'right'"),
    ],
)
def test_a_number_that_is_not_finite_is_named(bad: float, column: int, words: str):
    action = np.zeros((4, 15), np.float32)
    action[3, column] = bad
    with pytest.raises(
        ActionError, match=f"action number {column} is .* in environment 3.*{words}"
    ):
        ActionReader(TWO, 4).read(action)


def test_large_finite_numbers_pass():
    action = np.full((1, 8), 3e38, np.float32)
    assert np.array_equal(ActionReader(single({"arm": "panda"}), 1).read(action), action)


def test_only_the_very_array_that_was_checked_before_is_not_checked_again():
    reader = ActionReader(TWO, 2)
    reader.checked = checked = np.zeros((2, 15), np.float32)
    assert reader.read(checked) is checked
    same = checked.copy()
    same[1, 3] = np.nan
    with pytest.raises(ActionError, match="action number 3 is nan in environment 1"):
        reader.read(same)
