"""`tasks.maths`: every name, on both kinds of arrays, and what it says of names that it lacks."""

import numpy as np
import pytest
import torch

from tasks import maths

TYPES = {"Array", "Flags", "Floats"}
ROWS = np.random.default_rng(0).normal(size=(40, 3)).astype(np.float32)
OTHERS = np.random.default_rng(1).normal(size=(40, 3)).astype(np.float32)
FLAGS = ROWS > 0.0
POSITIVE = np.abs(ROWS)
UNIT = ROWS / 10.0

# Name: arguments of each call, the arrays among them as NumPy's.
CALLS = {
    "abs": [(ROWS,)],
    "all": [(FLAGS,), (FLAGS, 1)],
    "all_finite": [(ROWS,)],
    "any": [(FLAGS,), (FLAGS, 1)],
    "arccos": [(UNIT,)],
    "arctan2": [(ROWS[:, 0], ROWS[:, 1])],
    "argmax": [(ROWS,), (ROWS, 1), (np.ones((2, 3), np.float32), 1)],
    "argmin": [(ROWS,), (ROWS, 1), (np.ones((2, 3), np.float32), 1)],
    "clip": [(ROWS, -0.5, 0.5)],
    "columns": [(ROWS, ((0, 2), (1, 0)))],
    "concatenate": [([ROWS, OTHERS],), ([ROWS, OTHERS], 1)],
    "copy": [(ROWS,)],
    "cos": [(ROWS,)],
    "counted": [(ROWS, 5)],
    "cross": [(ROWS, OTHERS)],
    "exp": [(ROWS,)],
    "floats": [(FLAGS,)],
    "full": [(ROWS, 4, 0.5), (ROWS, 4, True)],
    "like": [(ROWS, ((0.1, 0.2), (0.3, 0.4))), (ROWS, [0.1])],
    "log": [(POSITIVE,)],
    "max": [(ROWS,), (ROWS, 1), (FLAGS, 1)],
    "maximum": [(ROWS, OTHERS), (ROWS, 0.1)],
    "mean": [(ROWS,), (ROWS, 1)],
    "min": [(ROWS,), (ROWS, 1), (FLAGS, 1)],
    "minimum": [(ROWS, OTHERS), (ROWS, 0.1)],
    "norm": [(ROWS,)],
    "sin": [(ROWS,)],
    "sqrt": [(POSITIVE,)],
    "stack": [([ROWS, OTHERS],), ([ROWS, OTHERS], 1)],
    "sum": [(ROWS,), (ROWS, 1), (ROWS[:, 0],), (FLAGS, 1)],
    "tanh": [(ROWS,)],
    "where": [(FLAGS, ROWS, OTHERS), (FLAGS, 0.1, ROWS), (FLAGS, ROWS, 0.1)],
    "zeros": [(ROWS,)],
}
# What rounds is torch's on both, as it is in native.
TORCHS = {"cross": torch.linalg.cross, "exp": torch.exp, "log": torch.log}
TORCHS |= {"mean": torch.mean, "sum": torch.sum}
NUMPYS = ("abs", "all", "any", "argmax", "argmin", "max", "min", *TORCHS)


def tensors(value):
    if isinstance(value, list):
        return [*map(tensors, value)]
    return torch.from_numpy(value) if isinstance(value, np.ndarray) else value


def test_every_name_is_called():
    assert {*maths.__all__} - TYPES - {"by_torch", "rounded"} == {*CALLS}
    assert maths.rounded(0.1) == np.float32(0.1)
    halved = maths.by_torch(lambda x: x / 2)
    assert isinstance(halved(ROWS), np.ndarray)
    assert torch.equal(halved(tensors(ROWS)), tensors(halved(ROWS)))


@pytest.mark.parametrize("name", CALLS)
def test_both_kinds_of_arrays_give_the_same(name):
    for arguments in CALLS[name]:
        ours = getattr(maths, name)(*arguments)
        theirs = getattr(maths, name)(*map(tensors, arguments))
        assert isinstance(theirs, torch.Tensor | bool)
        if isinstance(theirs, torch.Tensor):
            assert not isinstance(ours, torch.Tensor)
            theirs = theirs.numpy()
            assert (ours.dtype, ours.shape) == (theirs.dtype, theirs.shape)
        np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("name", TORCHS)
def test_what_rounds_is_torchs(name):
    for arguments in CALLS[name]:
        native = TORCHS[name](*map(tensors, arguments))
        np.testing.assert_array_equal(getattr(maths, name)(*arguments), native.numpy())


@pytest.mark.parametrize("name", NUMPYS)
def test_a_name_of_numpys_means_what_it_means_there(name):
    for arguments in CALLS[name]:
        theirs = getattr(np, name)(*arguments)
        np.testing.assert_allclose(getattr(maths, name)(*arguments), theirs, 2e-6, 1e-5)
    if name in ("all", "any", "argmax", "argmin", "max", "mean", "min", "sum"):
        rows = arguments[0].astype(np.float32)
        theirs = getattr(np, name)(rows, axis=0)
        np.testing.assert_allclose(getattr(maths, name)(rows, axis=0), theirs, 2e-6, 1e-5)


@pytest.mark.parametrize("name", ["mean", "norm", "sum"])
@pytest.mark.parametrize("count", [5, 33, 64])
def test_a_batchs_rows_are_rounded_as_single_rows_are(name, count):
    rows = np.random.default_rng(2).normal(size=(25, count)).astype(np.float32).T  # not in order
    axis = () if name == "norm" else (1,)
    alone = [getattr(maths, name)(row[None], *axis) for row in rows]
    np.testing.assert_array_equal(getattr(maths, name)(rows, *axis), np.concatenate(alone))


def test_a_name_that_is_missing():
    with pytest.raises(AttributeError, match=r"no 'absolute'. Did you mean 'abs'\? It has"):
        maths.absolute  # noqa: B018
    with pytest.raises(AttributeError, match="It has Array, .*, argmin, .*, zeros"):
        maths.softmax  # noqa: B018
    assert not hasattr(maths, "power")
    assert dir(maths) == sorted(maths.__all__)
