"""Mp4 files that hold many episodes each."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

CODEC = "h264"
PIXEL_FORMAT = "yuv420p"
# A keyframe every second frame, as LeRobot has them, so that any frame is near one; no frames
# that refer to later ones, so that frame k is shown at k / fps exactly.
ENCODING = ["-g", "2", "-bf", "0", "-crf", "23", "-preset", "veryfast", "-movflags", "+faststart"]
PIXELS_PER_BYTE = 8  # of small pictures; large ones take less
SIDES = 2  # widths and heights are multiples of it: colour is stored for four pixels at once


@dataclass
class VideoFile:
    """An mp4 file that is being written.

    Attributes:
        path: The file.
        fps: Frames per second.
        pixels: Of a frame.
        frames: Frames written so far.
    """

    path: Path
    fps: int
    pixels: int
    frames: int = 0

    def __post_init__(self) -> None:
        """Begin the file."""
        import imageio.v2 as imageio

        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._writer: Any = imageio.get_writer(
            self.path,
            fps=self.fps,
            codec="libx264",
            quality=None,
            pixelformat=PIXEL_FORMAT,
            macro_block_size=SIDES,
            output_params=ENCODING,
        )

    @property
    def seconds(self) -> float:
        """Length of what is written so far (s)."""
        return self.frames / self.fps

    @property
    def size(self) -> int:
        """About how many bytes it has; those on disk depend on how fast it is written."""
        return self.frames * self.pixels // PIXELS_PER_BYTE

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Write one more frame."""
        self._writer.append_data(picture)
        self.frames += 1

    def close(self) -> None:
        """Finish the file; closing twice is allowed."""
        self._writer.close()
