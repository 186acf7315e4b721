"""What is laid out: three panels with the pictures as they are, and a sheet of moments."""

import numpy as np
import pytest

from parity.show.panels import GAP, SHEET_COLUMNS, Labels, contact_sheet, moments, side_by_side
from parity.show.side_by_side import Frame

LABELS = Labels("PickCube-v1, seed 3", 8.0, 50)


def frame(step: int = 7, size: int = 192, apart: int = 3, success: bool = False) -> Frame:
    rng = np.random.default_rng(step)
    native = rng.integers(0, 200, (size, size, 3), np.uint8)
    ours = native.copy()
    ours[5, 6] += apart
    return Frame(step, native, ours, (0.25, 0.25) if step else None, (success, success))


@pytest.mark.parametrize("size", [192, 256, 384, 512])
def test_the_panels_hold_the_pictures(size):
    shown = frame(size=size)
    picture = side_by_side(shown, LABELS)
    height, width, _ = picture.shape
    assert height % 16 == width % 16 == 0, "h264 encodes blocks of 16"
    assert width == 3 * size + 2 * GAP
    native, ours, delta = (
        picture[height - size :, left : left + size] for left in (0, size + GAP, 2 * (size + GAP))
    )
    assert np.array_equal(native, shown.native)
    assert np.array_equal(ours, shown.ours)
    assert delta[5, 6].tolist() == [24, 24, 24]
    assert np.count_nonzero(delta) == 3


def test_equal_pictures_leave_the_third_panel_black():
    picture = side_by_side(frame(apart=0), LABELS)
    assert not picture[-192:, -192:].any()


def test_the_labels_tell_step_success_reward_and_difference():
    """Each changes what is written above the panels, and nothing below."""
    usual = side_by_side(frame(), LABELS)
    for other in (
        side_by_side(frame(success=True), LABELS),
        side_by_side(frame(), Labels("PickCube-v1, seed 4", 8.0, 50)),
        side_by_side(frame(), Labels("PickCube-v1, seed 3", 8.0, 51)),
        side_by_side(Frame(7, frame().native, frame().ours, (0.5, 0.25), (False, False)), LABELS),
        side_by_side(Frame(8, frame().native, frame().ours, (0.25, 0.25), (False, False)), LABELS),
        side_by_side(Frame(7, frame().native, frame().ours, None, (False, False)), LABELS),
    ):
        rows = np.flatnonzero((other != usual).any((1, 2)))
        assert len(rows)
        assert rows.max() < len(usual) - 192


@pytest.mark.parametrize(
    ("count", "shown"),
    [(1, [0]), (3, [0, 1, 2]), (8, list(range(8))), (71, [0, 10, 20, 30, 40, 50, 60, 70])],
)
def test_moments(count, shown):
    assert moments(count) == shown
    assert len(moments(1000)) == SHEET_COLUMNS


def test_a_sheet_is_wider_with_more_moments():
    few, many = (contact_sheet([frame(i) for i in range(n)], LABELS, "ok") for n in (2, 8))
    assert few.shape[0] == many.shape[0]
    assert few.shape[1] < many.shape[1]


def test_a_single_differing_pixel_is_seen_on_the_sheet():
    same, other = (contact_sheet([frame(size=384, apart=a)], LABELS, "ok") for a in (0, 30))
    lowest_panel = slice(-32 - 240, -40)
    assert (same != other)[lowest_panel].any()
