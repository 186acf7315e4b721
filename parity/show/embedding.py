"""Makes clips fit into a page: a poster of each, and smaller encodings where there are too many."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from robots import MissingPackageError, RobotLayoutsError
from rollouts.video import INSTALL

POSTER_WIDTH = 960  # pixels
# Width (pixels, at most) and quality (h264's CRF; larger is coarser), tried in this order.
ENCODINGS = ((1184, 22), (1184, 25), (1184, 28), (960, 30), (800, 32), (640, 35), (480, 38))


class ClipError(RobotLayoutsError, ValueError):
    """A clip that cannot be read, or does not fit."""


@dataclass(frozen=True)
class Embedded:
    """A clip as it goes into a page.

    Attributes:
        video: An mp4 file's bytes.
        poster: A jpeg's bytes: the last picture.
        width: Pixels.
        height: Pixels.
    """

    video: bytes
    poster: bytes
    width: int
    height: int


def take(paths: Sequence[Path], room: int, posters: Mapping[Path, bytes]) -> dict[Path, Embedded]:
    """Return clips that take no more room than there is, the small ones as they are.

    Args:
        paths: mp4 files.
        room: Bytes that the videos may take together.
        posters: What `poster` returned for each.

    Raises:
        ClipError: If they cannot be made as small as that, or one cannot be read.
        MissingPackageError: If imageio-ffmpeg, which brings ffmpeg, is not installed.
    """
    shares = share({path: path.stat().st_size for path in paths}, room)
    return {path: Embedded(fit(path, shares[path]), posters[path], *size(path)) for path in paths}


def share(sizes: Mapping[Path, int], room: int) -> dict[Path, int]:
    """Divide room: who needs less than an equal share leaves the rest to the others (bytes)."""
    shares: dict[Path, int] = {}
    left = room
    for number, path in enumerate(sorted(sizes, key=lambda path: sizes[path])):
        shares[path] = min(sizes[path], left // (len(sizes) - number))
        left -= shares[path]
    return shares


def fit(path: Path, room: int) -> bytes:
    """Return a clip in at most ``room`` bytes, coarser only if it has to be.

    Raises:
        ClipError: If even the coarsest encoding is larger, or it cannot be read.
    """
    video = path.read_bytes()
    if len(video) <= room:
        return video
    for width, quality in ENCODINGS:
        video = _ffmpeg(
            *("-i", str(path), "-an", "-c:v", "libx264", "-pix_fmt", "yuv420p"),
            *("-crf", str(quality), "-preset", "slow", "-vf", f"scale='min({width},iw)':-2"),
            *("-movflags", "frag_keyframe+empty_moov", "-f", "mp4", "pipe:1"),
        )
        if len(video) <= room:
            return video
    raise ClipError(
        f"{path} takes {len(video):,} bytes at its coarsest, and there is room for {room:,}"
    )


def poster(path: Path) -> bytes:
    """Return the last picture of a clip as a jpeg.

    Raises:
        ClipError: If the clip cannot be read.
    """
    picture = _ffmpeg(
        *("-sseof", "-1", "-i", str(path), "-vf", f"scale='min({POSTER_WIDTH},iw)':-2"),
        *("-update", "1", "-q:v", "4", "-f", "image2", "-c:v", "mjpeg", "pipe:1"),
    )
    # One picture after the other: the last one counts.
    start = picture.rfind(b"\xff\xd8\xff")
    if start < 0:
        raise ClipError(f"{path} holds no picture")
    return picture[start:]


def size(path: Path) -> tuple[int, int]:
    """Return width and height of a clip (pixels).

    Raises:
        ClipError: If it cannot be read.
    """
    done = subprocess.run(
        [_executable(), "-hide_banner", "-i", str(path)], capture_output=True, check=False
    )
    found = re.search(r"Video:.*?, ([1-9]\d*)x([1-9]\d*)[ ,]", done.stderr.decode(errors="replace"))
    if found is None:
        raise ClipError(f"{path} is no video")
    return int(found[1]), int(found[2])


def _ffmpeg(*arguments: str) -> bytes:
    command = [_executable(), "-hide_banner", "-loglevel", "error", *arguments]
    done = subprocess.run(command, capture_output=True, check=False)
    if done.returncode != 0:
        output = done.stderr.decode(errors="replace").strip().splitlines() or ["no message"]
        path = arguments[arguments.index("-i") + 1]
        raise ClipError(f"{path} cannot be read as a video: {output[-1]}")
    return done.stdout


def _executable() -> str:
    try:
        from imageio_ffmpeg import get_ffmpeg_exe
    except ImportError:
        raise MissingPackageError(f"clips need imageio-ffmpeg: {INSTALL}") from None
    return get_ffmpeg_exe()
