"""Motions: between the knots, beyond the ends, and what is refused."""

import pickle

import numpy as np
import pytest

from robot_layouts.motion import Motion, MotionError
from robots import UnknownNameError
from tests.motion.two_pandas import cell

TIMES = np.linspace(0.0, 2.0, 21)


def waves(times=TIMES, **changes):
    layout = cell()
    phases = np.arange(9) / 9
    positions = {name: np.sin(times[:, None] + phases) for name in layout}
    velocities = {name: np.cos(times[:, None] + phases) for name in layout}
    return Motion(
        **{"layout": layout, "times": times, "positions": positions, "velocities": velocities}
        | changes
    )


def test_a_motion_follows_its_curve_between_the_knots():
    motion, fine = waves(), np.linspace(0.0, 2.0, 501)
    expected = np.sin(fine[:, None] + np.arange(9) / 9)
    assert np.allclose(motion.sample(fine)["left"], expected, atol=1e-6)
    expected = np.cos(fine[:, None] + np.arange(9) / 9)
    assert np.allclose(motion.velocity(fine)["right"], expected, atol=1e-4)


def test_the_knots_are_met_exactly():
    motion = waves()
    for name, qpos in motion.sample(motion.times).items():
        assert np.array_equal(qpos, motion.positions[name])
    for name, speeds in motion.velocity(motion.times).items():
        assert np.array_equal(speeds, motion.velocities[name])


def test_beyond_its_ends_a_motion_stands_still():
    motion = waves()
    assert np.array_equal(motion.sample(5.0)["left"], motion.end["left"])
    assert np.array_equal(motion.sample(-1.0)["left"], motion.start["left"])
    assert not motion.velocity([-1.0, 5.0])["left"].any()


def test_one_time_gives_one_posture():
    motion = waves()
    assert motion.sample(0.5)["left"].shape == (9,)
    assert motion.sample([0.5])["left"].shape == (1, 9)
    assert motion.duration == 2.0


def test_who_moves_is_known():
    still = {"left": waves().positions["left"], "right": np.zeros((21, 9))}
    rest = {"left": waves().velocities["left"], "right": np.zeros((21, 9))}
    assert waves(positions=still, velocities=rest).moving == ("left",)


def test_a_motion_cannot_be_changed_and_pickles():
    motion = waves()
    with pytest.raises(ValueError, match="read-only"):
        motion.positions["left"][0] = 0.0
    copy = pickle.loads(pickle.dumps(motion))
    assert copy.layout == motion.layout
    assert np.array_equal(copy.sample(0.3)["left"], motion.sample(0.3)["left"])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"times": TIMES + 1.0}, "begin with 0"),
        ({"times": np.zeros(21)}, "increase"),
        (
            {"positions": {n: np.zeros((20, 9)) for n in ("left", "right")}},
            r"\(20, 9\); it must be \(21, 9\)",
        ),
        ({"positions": {"left": np.zeros((21, 9))}}, "positions lacks right"),
        ({"velocities": 3.0}, "takes a mapping"),
        ({"velocities": {n: np.full((21, 9), np.nan) for n in ("left", "right")}}, "holds nan"),
        ({"times": np.linspace(0.0, 2e6, 21)}, "1e.06 s at most"),
        ({"velocities": {n: np.full((21, 9), 2e6) for n in ("left", "right")}}, "holds 2e.06"),
        ({"largest_velocities": {"left": -np.ones(9)}}, "must be > 0"),
        ({"largest_velocities": {"left": np.ones(3)}}, r"\(3,\); it must be \(9,\)"),
    ],
)
def test_arrays_that_do_not_fit_are_refused(changes, message):
    with pytest.raises(MotionError, match=message):
        waves(**changes)


def test_a_robot_that_is_not_there_is_refused_by_name():
    with pytest.raises(UnknownNameError, match="Did you mean 'left'"):
        waves(positions={"lef": np.zeros((21, 9))})


def swing(start, end):
    """From one position of all joints to another and to rest there, in 2 s."""
    share = (1 - np.cos(np.pi * TIMES / 2)) / 2
    speed = np.pi / 4 * np.sin(np.pi * TIMES / 2)
    speed[[0, -1]] = 0.0
    positions = {n: np.tile(start + (end - start) * share[:, None], 9) for n in cell()}
    velocities = {n: np.tile((end - start) * speed[:, None], 9) for n in cell()}
    return waves(positions=positions, velocities=velocities)


def test_one_motion_follows_another():
    there, back = swing(0.0, 1.0), swing(1.0, 0.0)
    whole = there.then(back, rest=0.5).then(there)
    assert whole.duration == 6.5
    assert np.allclose(whole.sample(2.5 + 0.7)["left"], back.sample(0.7)["left"])
    assert np.allclose(whole.sample(2.2)["left"], 1.0)
    assert np.allclose(whole.sample(6.0)["right"], there.sample(1.5)["right"])


def test_motions_that_do_not_meet_at_rest_do_not_follow_each_other():
    with pytest.raises(MotionError, match="left begins 1 from where it ended"):
        swing(0.0, 1.0).then(swing(0.0, 1.0))
    with pytest.raises(MotionError, match="left does not stand still"):
        waves().then(waves())
    with pytest.raises(MotionError, match="rest is -1"):
        swing(0.0, 1.0).then(swing(1.0, 0.0), rest=-1)
