"""Lays pictures out for people: labelled panels side by side, and a sheet of moments of a clip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import ceil
from typing import Any, NamedTuple

import numpy as np

from parity.show.native_pictures import Picture, amplified
from parity.show.side_by_side import Frame
from robots import MissingPackageError
from rollouts.video import INSTALL

BACKGROUND, INK, FAINT, GREEN = "#1d2126", "#f2f4f6", "#98a1ab", "#4cc38a"
ALARM = "#ff8f6b"

UNIT = 384  # pixels of the panel that the lengths below are for
GAP = 16  # between panels
HEADER = 80  # above the panels
MARGIN = 8
TEXT, TITLE = 16, 20  # heights

SHEET_COLUMNS = 8
SHEET_PANEL = 232  # pixels
SHEET_LABELS = 112  # column of row names
SHEET_GAP = 8


@dataclass(frozen=True)
class Labels:
    """Words over the panels.

    Attributes:
        headline: What is shown, over all panels.
        gain: Factor by which the difference is amplified.
        last_step: Step of the clip's last frame.
    """

    headline: str
    gain: float
    last_step: int

    @property
    def difference(self) -> str:
        """Title of the third panel."""
        return f"difference x {self.gain:g}"


def side_by_side(frame: Frame, labels: Labels) -> Picture:
    """Return native | ours | amplified difference, with their labels.

    Args:
        frame: What to show, its pictures S × S with S a multiple of 16.
        labels: What to write.

    Returns:
        Shape (H, 3 S + 32, 3), H and the width multiples of 16.

    Raises:
        MissingPackageError: If pillow is not installed.
    """
    size, delta = len(frame.native), frame.difference
    header = _multiple_of_16(HEADER * size / UNIT)
    canvas = _Canvas(3 * size + 2 * GAP, header + size, size / UNIT)
    for number, picture in enumerate((frame.native, frame.ours, amplified(delta, labels.gain))):
        canvas.paste(picture, number * (size + GAP), header)
    canvas.write(MARGIN, 4, labels.headline, TEXT, FAINT)
    canvas.write_right(
        canvas.width - MARGIN, 4, f"step {frame.step} of {labels.last_step}", TEXT, INK
    )
    for number, title in enumerate(("native", "ours")):
        left = number * (size + GAP) + MARGIN
        canvas.write(left, 28, title, TITLE, INK)
        canvas.write(left, 54, _reward_text(frame, number), TEXT, FAINT)
        right = left - 2 * MARGIN + size
        _mark(canvas, right, 54, frame.success[number])
    left = 2 * (size + GAP) + MARGIN
    canvas.write(left, 28, labels.difference, TITLE, INK)
    canvas.write(left, 54, *_difference_text(delta))
    return canvas.picture()


def contact_sheet(frames: Sequence[Frame], labels: Labels, verdict: str) -> Picture:
    """Return moments of a clip from left to right: native above ours above their difference.

    Args:
        frames: What to show.
        labels: What to write.
        verdict: What came of it, under the headline.

    Raises:
        MissingPackageError: If pillow is not installed.
    """
    top, under, bottom = 72, 28, 32
    step = SHEET_PANEL + SHEET_GAP
    width = SHEET_LABELS + len(frames) * step + MARGIN
    canvas = _Canvas(width, top + under + 3 * step + bottom, 1.0)
    canvas.write(MARGIN * 2, 10, labels.headline, TITLE, INK)
    canvas.write(MARGIN * 2, 40, verdict, TEXT, FAINT)
    for row, title in enumerate(("native", "ours", labels.difference)):
        for line, words in enumerate(_two_lines(title)):
            height = top + under + row * step + SHEET_PANEL // 2 - 22 + 22 * line
            canvas.write(MARGIN * 2, height, words, TITLE - 2, INK)
    for column, frame in enumerate(frames):
        left = SHEET_LABELS + column * step
        canvas.write(left, top, f"step {frame.step}", TEXT, INK)
        if all(frame.success):
            _mark(canvas, left + SHEET_PANEL, top, True)
        # Amplified first: shrinking would blur what is faint away.
        rows = (frame.native, frame.ours, amplified(frame.difference, labels.gain))
        for row, picture in enumerate(rows):
            canvas.paste(picture, left, top + under + row * step, SHEET_PANEL)
        canvas.write(left, top + under + 3 * step, *_difference_text(frame.difference))
    return canvas.picture()


def moments(count: int) -> list[int]:
    """Return which of ``count`` frames a sheet shows: the first, the last, and evenly between."""
    return sorted({int(i) for i in np.linspace(0, count - 1, SHEET_COLUMNS).round()})


class _Canvas:
    """A picture to write on; lengths of text are for panels of `UNIT` and scaled."""

    def __init__(self, width: int, height: int, scale: float) -> None:
        pillow = _pillow()
        self.width, self._scale = width, scale
        self._image = pillow.image.new("RGB", (width, height), BACKGROUND)
        self._draw = pillow.draw.Draw(self._image)

    def paste(self, picture: Picture, left: int, top: int, size: int | None = None) -> None:
        image = _pillow().image.fromarray(picture)
        self._image.paste(image if size is None else image.resize((size, size)), (left, top))

    def write(self, left: float, top: float, words: str, height: int, colour: str) -> None:
        at = (left, top * self._scale)
        self._draw.text(at, words, fill=colour, font=_font(height * self._scale))

    def write_right(self, right: float, top: float, words: str, height: int, colour: str) -> None:
        width = self._draw.textlength(words, font=_font(height * self._scale))
        self.write(right - width, top, words, height, colour)

    def picture(self) -> Picture:
        return np.asarray(self._image).copy()


def _mark(canvas: _Canvas, right: float, top: float, success: bool) -> None:
    words, colour = ("success", GREEN) if success else ("not yet", FAINT)
    canvas.write_right(right, top, words, TEXT, colour)


def _reward_text(frame: Frame, side: int) -> str:
    return "after the reset" if frame.rewards is None else f"reward {frame.rewards[side]:.4f}"


def _difference_text(delta: Picture) -> tuple[str, int, str]:
    if not delta.any():
        return "every pixel equal", TEXT, FAINT
    return f"mean {delta.mean():.4f}, largest {delta.max()} of 255", TEXT, ALARM


def _two_lines(title: str) -> list[str]:
    first, _, rest = title.partition(" ")
    return [first, rest]


def _multiple_of_16(length: float) -> int:
    return 16 * ceil(length / 16)


@cache
def _font(height: float) -> Any:
    return _pillow().font.load_default(height)


class _Pillow(NamedTuple):
    image: Any
    draw: Any
    font: Any


def _pillow() -> _Pillow:
    try:
        from PIL import Image, ImageDraw, ImageFont
    except ImportError:
        raise MissingPackageError(f"pictures side by side need pillow: {INSTALL}") from None
    return _Pillow(Image, ImageDraw, ImageFont)
