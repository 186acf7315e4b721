"""Pictures of a robomimic dataset: arrays of whole numbers, compressed frame by frame."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from rollouts.export.shots import Channel, Frame
from tasks.engine.cameras import expect_apart
from tasks.engine.columns import ROBOMIMIC, picture_column

LEVEL = 1  # of compression: drawing takes long, not this


class PictureArrays:
    """Writes pictures into the groups of demonstrations, all of the same channels."""

    def __init__(self, channels: Sequence[Channel]) -> None:
        """Begin.

        Args:
            channels: Which pictures there are of every moment.

        Raises:
            TaskError: If pictures of two cameras would be called the same.
        """
        self._names = {c: picture_column(ROBOMIMIC, c.camera, c.texture) for c in channels}
        expect_apart(self._names.values())

    def add(
        self, demo: Any, steps: int, frames: Iterable[Frame], watch: Callable[[int], None]
    ) -> None:
        """Write what is seen before and after each step, ``obs`` and ``next_obs``.

        A picture that stands in both is compressed once.

        Args:
            demo: The group of the demonstration.
            steps: Its steps T.
            frames: The pictures of T + 1 moments.
            watch: Called with the number of moments whose pictures are written.
        """
        arrays = {
            c: [_array(demo, f"{o}/{name}", steps, c) for o in ("obs", "next_obs")]
            for c, name in self._names.items()
        }
        for moment, frame in enumerate(frames):
            for channel, (before, after) in arrays.items():
                packed = zlib.compress(frame[channel].tobytes(), LEVEL)
                if moment < steps:
                    before.id.write_direct_chunk((moment, 0, 0, 0), packed)
                if moment > 0:
                    after.id.write_direct_chunk((moment - 1, 0, 0, 0), packed)
            watch(moment + 1)


def _array(demo: Any, name: str, steps: int, channel: Channel) -> Any:
    shape = channel.shape
    return demo.create_dataset(
        name,
        (steps, *shape),
        channel.dtype,
        chunks=(1, *shape),
        compression="gzip",
        compression_opts=LEVEL,
    )
