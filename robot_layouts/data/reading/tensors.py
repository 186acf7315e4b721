"""Tensors by name in a file of the format safetensors: a header in json, then their numbers."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from math import prod
from os import PathLike
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from typing_extensions import TypedDict

from robot_layouts.core.files import parse_json, read_regular
from robot_layouts.core.schema import FieldError, check, exactly, length, whole
from robot_layouts.core.writing import write_whole
from robots import UnreadableFileError

MAX_BYTES = 2**28  # of a file
MAX_HEADER = 2**20
_METADATA = "__metadata__"
_PICKLES = (b"PK\x03\x04", b"\x80")  # what begins files of torch.save, and other pickles
_PICKLED = (
    "it is a pickle or an archive of some, as torch.save writes; pickles can run code when they are"
    " read, and are never read here"
)
_Offset = Annotated[int, whole(0, MAX_BYTES)]


class _Tensor(TypedDict):
    dtype: Annotated[str, exactly("F32")]
    shape: list[_Offset]
    data_offsets: Annotated[list[_Offset], length(2)]


def read_tensors(path: str | PathLike[str]) -> dict[str, NDArray[np.float32]]:
    """Return the tensors of a file by name; nothing in it is executed.

    Raises:
        UnreadableFileError: If it cannot be read, is larger than 256 MB, a pickle, not in that
            format, or has other numbers than finite ones of 32 bits.
    """
    content = read_regular(path, MAX_BYTES)
    try:
        return dict(_tensors(content))
    except (FieldError, ValueError) as error:
        what = _PICKLED if content.startswith(_PICKLES) else f"it is no safetensors file: {error}"
        raise UnreadableFileError(path, what) from error


def _tensors(content: bytes) -> Iterator[tuple[str, NDArray[np.float32]]]:
    size = int.from_bytes(content[:8], "little")
    if not 0 < size <= min(MAX_HEADER, len(content) - 8):
        raise ValueError(f"its header would have {size:,} bytes")
    header, numbers = parse_json(content[8 : 8 + size].decode()), content[8 + size :]
    entries = check(header, dict[str, Any], "the header")
    entries.pop(_METADATA, None)
    abouts = {name: check(about, _Tensor, repr(name)) for name, about in entries.items()}
    end = 0
    for name, about in sorted(abouts.items(), key=lambda entry: entry[1]["data_offsets"]):
        first, last = about["data_offsets"]
        size = 4 * prod(about["shape"])
        if first != end or last - first != size or last > len(numbers):
            raise ValueError(f"{name!r} has other bytes than its shape and the tensors before say")
        end = last
        tensor = np.frombuffer(numbers[first:last], "<f4").astype(np.float32)
        if not np.isfinite(tensor).all():
            raise ValueError(f"{name!r} has numbers that are not finite")
        yield name, tensor.reshape(about["shape"])
    if end != len(numbers):
        raise ValueError(f"{len(numbers):,} bytes follow its header, and its tensors have {end:,}")


def write_tensors(path: str | PathLike[str], tensors: Mapping[str, NDArray[np.float32]]) -> None:
    """Write tensors of 32 bits by name.

    Raises:
        UnwritableFileError: If it cannot be written.
    """
    header, parts, end = dict[str, Any](), list[bytes](), 0
    for name, tensor in sorted(tensors.items()):
        parts.append(np.ascontiguousarray(tensor, "<f4").tobytes())
        first, end = end, end + len(parts[-1])
        shape = [*tensor.shape]
        header[name] = {"dtype": "F32", "shape": shape, "data_offsets": [first, end]}
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)  # so that numbers begin at a multiple of eight
    write_whole(path, b"".join([len(text).to_bytes(8, "little"), text, *parts]))
