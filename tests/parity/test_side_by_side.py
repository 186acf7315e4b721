"""Which episode a clip shows, where it ends, and how its pixels are counted."""

import numpy as np
import pytest

from parity.compare.lockstep import EpisodeResult
from parity.compare.snapshot import QUANTITIES
from parity.show.side_by_side import PixelCount, Playback, most_alike
from tasks.episode import Episode


def snapshots(steps: int, success: int | None) -> list:
    return [{("info", "success"): np.array([success == step])} for step in range(steps + 1)]


def playback(steps: int, native: int | None, ours: int | None, apart: float = 0.0) -> Playback:
    """An episode with success at one step of each side, or never."""
    largest = {quantity: 0.0 for quantity in QUANTITIES} | {"qpos": apart, "reward": 9.0}
    result = EpisodeResult(0, steps, 0, native is not None, ours is not None, largest, None)
    episode = Episode(0, np.zeros((steps, 8), np.float32))
    return Playback(episode, result, snapshots(steps, native), snapshots(steps, ours))


@pytest.mark.parametrize(
    ("native", "ours", "buffer", "frames"),
    [
        (20, 20, 10, 31),  # the reset's frame and 20 + 10 steps
        (20, 23, 10, 34),  # the later of the two
        (20, 20, 0, 21),
        (45, 45, 10, 51),  # no more than there are
        (20, None, 10, 51),
        (None, None, 10, 51),
        (20, 20, None, 51),
    ],
)
def test_where_a_clip_ends(native, ours, buffer, frames):
    assert playback(50, native, ours).frames(buffer) == frames


def test_success_and_difference():
    found = playback(50, 20, 23, apart=1e-7)
    assert found.success_steps == (20, 23)
    assert found.both_succeed
    assert found.max_state_difference == 1e-7, "rewards are no state"
    assert not playback(50, 20, None).both_succeed


def test_the_most_alike_is_one_that_succeeds():
    fails, differs = playback(10, None, None), playback(50, 20, 20, apart=1e-6)
    long, short = playback(50, 30, 30), playback(90, 20, 20)
    assert most_alike([fails, differs], 10) is differs
    assert most_alike([fails, long, differs], 10) is long
    assert most_alike([long, short, fails], 10) is short
    assert most_alike([long, short], None) is long, "no step is left out: 50 are fewer than 90"
    assert most_alike(iter([fails]), 10) is fails


def test_pixels_are_counted_over_all_frames():
    pixels = PixelCount()
    assert pixels.mean == 0.0
    delta = np.zeros((4, 4, 3), np.uint8)
    pixels.add(delta)
    delta[0, 0] = (10, 200, 30)
    pixels.add(delta)
    assert (pixels.frames, pixels.differing_frames, pixels.largest) == (2, 1, 200)
    assert pixels.mean == pytest.approx(240 / 96)
