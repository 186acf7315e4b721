"""What identifies the pictures that policies observed in an episode: a digest of each of them."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot_layouts.data.playing.together import EpisodePlayer

BYTES = 2  # of a digest that are kept of each moment

Image = NDArray[Any]  # (H, W, k); of points (P, k)
Images = dict[str, dict[int, Image]]
"""By the picture's name and the control step, 0 being the reset."""


@dataclass(frozen=True)
class WatchedPictures:
    """Which pictures of an evaluation get a digest, and which are returned.

    Attributes:
        interval: Those after the reset and each so many-th control step get one.
        kept: Whether all of these are returned.
        expected: Seed → picture's name → first bytes of the digests that it should have, (M, 2);
            the first picture that has another one is returned.
    """

    interval: int = 1
    kept: bool = False
    expected: Mapping[int, Mapping[str, NDArray[np.uint8]]] = field(
        default_factory=dict[int, Mapping[str, NDArray[np.uint8]]]
    )


@dataclass(frozen=True)
class PictureTrace:
    """What identifies the pictures of one camera and texture in an episode.

    Attributes:
        pictures: SHA-256, in hex, over the SHA-256 of each.
        trace: The first two bytes of each one's SHA-256, in base64.
    """

    pictures: str
    trace: str


def pictures_of(observation: Any) -> dict[str, Any]:
    """Return the pictures in an observation, (N, H, W, k) each, or points, (N, P, k).

    They are named by camera and texture, such as ``base_camera/rgb``; where an observation has the
    columns of a dataset, by these.
    """
    return dict(_pictures(observation, ""))


def _pictures(tree: Any, name: str) -> Iterator[tuple[str, Any]]:
    if isinstance(tree, Mapping):
        for key, part in tree.items():
            if key != "sensor_param":
                yield from _pictures(part, f"{name}/{key}" if name else key)
    elif tree.ndim > 2:  # states are rows of numbers
        yield name.removeprefix("sensor_data/"), tree


def picture_digest(image: Image) -> bytes:
    """Return the SHA-256 of a picture's type and shape, and of its bytes."""
    digest = sha256(f"{image.dtype.str} {image.shape}\n".encode())
    digest.update(image.tobytes())
    return digest.digest()


def trace_of_pictures(digests: Iterable[bytes]) -> PictureTrace:
    """Return what identifies pictures, of which these are the SHA-256."""
    every = list(digests)
    kept = b"".join(digest[:BYTES] for digest in every)
    return PictureTrace(sha256(b"".join(every)).hexdigest(), b64encode(kept).decode())


class PictureWatch:
    """Looks at the pictures of episodes that are played at once."""

    def __init__(self, watched: WatchedPictures, players: Sequence[EpisodePlayer]) -> None:
        """Look at nothing yet.

        Args:
            watched: At which to look.
            players: Who plays, one after the other in the environments.
        """
        self._players, self._interval = players, watched.interval
        self._episodes = [
            _EpisodePictures(watched.kept, watched.expected.get(player.seed, {}))
            for player in players
        ]

    def __call__(self, observation: Any) -> None:
        """Look at what is observed after the reset, and then after each step."""
        step = max(len(player.moments) for player in self._players)
        if step % self._interval:
            return
        for name, rows in pictures_of(observation).items():
            for i, player in enumerate(self._players):
                if len(player.moments) == step:  # it is not over
                    self._episodes[i].add(name, step, np.asarray(rows[i]))

    def traces(self, player: int) -> dict[str, PictureTrace]:
        """Return what identifies the pictures that a player saw, by their names."""
        found = self._episodes[player].digests
        return {name: trace_of_pictures(digests) for name, digests in found.items()}

    def images(self, player: int) -> Images:
        """Return those of its pictures that were to be returned."""
        return self._episodes[player].images


class _EpisodePictures:
    def __init__(self, kept: bool, expected: Mapping[str, NDArray[np.uint8]]) -> None:
        self.digests: dict[str, list[bytes]] = {}
        self.images: Images = {}
        self._kept, self._expected = kept, expected

    def add(self, name: str, step: int, image: Image) -> None:
        digest, known = picture_digest(image), self.digests.setdefault(name, [])
        known.append(digest)
        if self._kept or (name not in self.images and self._unlike(name, len(known) - 1, digest)):
            self.images.setdefault(name, {})[step] = image.copy()

    def _unlike(self, name: str, place: int, digest: bytes) -> bool:
        expected = self._expected.get(name, ())
        return place < len(expected) and expected[place].tobytes() != digest[:BYTES]
