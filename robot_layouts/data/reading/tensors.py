"""Tensors by name in a safetensors file, which holds numbers and nothing that runs."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from robot_layouts.core.files import read_regular
from robot_layouts.core.writing import write_whole
from robots import UnreadableFileError

MAX_BYTES = 2**28  # of a file
_PICKLES = (b"PK\x03\x04", b"\x80")  # what begins files of torch.save, and other pickles
_PICKLED = (
    "it is a pickle or an archive of some, as torch.save writes; pickles can run code when they are"
    " read, and are never read here"
)


def read_tensors(path: str | PathLike[str]) -> dict[str, NDArray[np.float32]]:
    """Return the tensors of a file by name; nothing in it is executed.

    Raises:
        UnreadableFileError: If it cannot be read, is larger than 256 MB, a pickle, not in that
            format, or has other numbers than finite ones of 32 bits.
    """
    content = read_regular(path, MAX_BYTES)
    if content.startswith(_PICKLES):
        raise UnreadableFileError(path, _PICKLED)
    try:
        tensors = load(content)
    except (SafetensorError, KeyError) as error:  # KeyError: a type that NumPy lacks
        raise UnreadableFileError(path, f"it is no safetensors file: {error}") from error
    for name, tensor in tensors.items():
        if tensor.dtype != np.float32 or not np.isfinite(tensor).all():
            raise UnreadableFileError(
                path, f"{name!r} has other numbers than finite ones of 32 bits"
            )
    return tensors


def write_tensors(path: str | PathLike[str], tensors: Mapping[str, NDArray[np.float32]]) -> None:
    """Write tensors of 32 bits by name.

    Raises:
        UnwritableFileError: If it cannot be written.
    """
    write_whole(path, save({name: np.array(x, order="C") for name, x in tensors.items()}))
