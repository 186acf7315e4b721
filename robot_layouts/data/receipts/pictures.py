"""Pictures beside a receipt: what was seen then, if it was kept, and what differs from it now."""

from __future__ import annotations

import io
import struct
import zlib
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any
from zipfile import BadZipFile, ZipFile

import numpy as np
from numpy.typing import NDArray

from robot_layouts.core.writing import write_whole
from robot_layouts.data.playing.evaluation_job import (
    Image,
    Images,
    PictureTrace,
    picture_digest,
    trace_of_pictures,
)
from tasks.engine.pictures import as_picture

_LARGEST = 2**30  # bytes of all pictures of an episode by one camera
_COLORS = ("rgb", "albedo", "Color")
_GREYS = ("depth", "position", "segmentation")

Pixels = NDArray[np.uint8]  # (H, W, 3)


@dataclass(frozen=True)
class PictureDifference:
    """Pictures of one camera that are not the same in an episode.

    Attributes:
        name: Camera and texture, such as ``base_camera/rgb``.
        step: The control step after which the first of them was taken, 0 being the reset; None if
            their short digests are equal.
        different: How many of them differ.
        compared: How many there are in both.
        here: The first of them, as it was drawn here; None if it was not.
    """

    name: str
    step: int | None
    different: int
    compared: int
    here: Image | None

    def __str__(self) -> str:
        """Name the picture."""
        if self.step is None:
            return f"pictures {self.name} differ"
        when = f"step {self.step}" if self.step else "the reset"
        counts = f"{self.different} of {self.compared}"
        return f"pictures {self.name} differ, first after {when} ({counts})"


def pictures_folder(receipt: str | PathLike[str]) -> Path:
    """Return where the pictures of a receipt are kept: beside it, in NAME.pictures."""
    return Path(receipt).with_suffix(".pictures")


def keep(images: Images, seed: int, folder: Path) -> None:
    """Write the pictures of an episode, each as it was observed.

    Raises:
        UnwritableFileError: If they cannot be written.
    """
    rows: Any = {name: np.stack(list(by_step.values())) for name, by_step in images.items()}
    file = io.BytesIO()
    np.savez_compressed(file, **rows)
    write_whole(_file(folder, seed), file.getvalue())


def kept(folder: Path, seed: int, name: str, recorded: PictureTrace) -> Image | None:
    """Return the pictures that were kept of an episode, (M, …), if they are those of a receipt.

    Args:
        folder: Where they are.
        seed: Of the episode.
        name: Camera and texture.
        recorded: What the receipt says of them.

    Returns:
        None if there are none, or any other than the receipt's.
    """
    try:
        with ZipFile(_file(folder, seed)) as file:
            member = f"{name}.npy"
            if file.getinfo(member).file_size > _LARGEST:
                return None
            rows = _array(file.read(member))
    except (OSError, EOFError, BadZipFile, zlib.error, KeyError, ValueError, RuntimeError):
        return None
    return rows if trace_of_pictures(map(picture_digest, rows)) == recorded else None


def _array(content: bytes) -> NDArray[Any]:
    """Return the array of an npy file, which is no larger than the file, whatever that claims.

    Raises:
        ValueError: If it is not one of numbers.
    """
    file = io.BytesIO(content)
    if np.lib.format.read_magic(file) != (1, 0):
        raise ValueError("not what `keep` writes")
    shape, _, dtype = np.lib.format.read_array_header_1_0(file)
    return np.frombuffer(content, dtype, offset=file.tell()).reshape(shape)


def _file(folder: Path, seed: int) -> Path:
    return folder / f"seed_{seed}.npz"


def side_by_side(name: str, before: Image | None, now: Image) -> Pixels | None:
    """Return a picture as it was and as it is, and in white the pixels that differ.

    Only as it is now, if it was not kept.

    Args:
        name: Camera and texture.
        before: As it was, or None.
        now: As it is.

    Returns:
        None if it has no colours to show, as points have none.
    """
    shown = _shown(name, now)
    if shown is None:
        return None
    then = None if before is None or before.shape != now.shape else _shown(name, before)
    if before is None or then is None:
        return shown
    differs = (before != now).any(-1, keepdims=True).repeat(3, -1)
    return np.concatenate([then, shown, differs * np.uint8(255)], 1)


def _shown(name: str, image: Image) -> Pixels | None:
    texture = name.rpartition("/")[2].rpartition(".")[2]
    if image.ndim != 3:
        return None
    if texture in _COLORS or (image.dtype == np.uint8 and image.shape[2] in (3, 4)):
        return image[..., :3].astype(np.uint8)
    if texture == "normal":
        return ((image[..., :3] + 1) * 127.5).astype(np.uint8)
    return as_picture(texture, image[None])[0] if texture in _GREYS else None


def write_png(path: Path, pixels: Pixels) -> None:
    """Write a picture as a png file, whole or not at all.

    Raises:
        UnwritableFileError: If it cannot be written.
    """
    height, width, _ = pixels.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], 1)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = {b"IHDR": header, b"IDAT": zlib.compress(rows.tobytes()), b"IEND": b""}
    parts = (
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks.items()
    )
    write_whole(path, b"\x89PNG\r\n\x1a\n" + b"".join(parts))
