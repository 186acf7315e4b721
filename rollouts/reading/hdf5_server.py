"""The process that reads h5 files for another one, which it may crash in the place of.

A request is a json array: a number that the other process gave the file, its path, what is wanted
(a function of this module), the name of a group, or an empty one, and names in it or null. The
answer is a json object, followed by the bytes of arrays if there are any.
"""

from __future__ import annotations

import json
import os
import resource
from collections.abc import Sequence
from multiprocessing.connection import Connection
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from rollouts.reading.hdf5_reading import ContentError, Hdf5Group, root

CPU_SECONDS = 5  # that HDF5 may take to look at something in a file, or to open it
BYTES_PER_SECOND = 2e7  # that it unpacks at least
MEMORY = 2**33  # bytes of address space

Arrays = dict[str, NDArray[Any]]
Answer = tuple[Any, Arrays]


def serve(descriptor: int) -> None:
    """Answer requests until the other process closes the connection, or ends.

    Args:
        descriptor: The socket to the other process.
    """
    _limit(resource.RLIMIT_AS, MEMORY)
    _limit(resource.RLIMIT_CORE, 0)
    connection, files = Connection(descriptor), dict[int, h5py.File]()
    while True:
        try:
            number, path, wanted, group, names = json.loads(connection.recv_bytes())
        except EOFError:
            os._exit(0)  # HDF5 may not come to an end closing a damaged file, either
        limit_processor()
        try:
            answer, arrays = _answer(files, number, path, wanted, group, names)
        except Exception as error:  # h5py's are of all kinds; this is where the process ends
            answer, arrays = {"error": str(error) or repr(error)}, Arrays()
        connection.send_bytes(json.dumps(answer).encode())
        for rows in arrays.values():
            connection.send_bytes(rows.data.cast("B") if rows.size else b"")


def limit_processor(seconds: float = CPU_SECONDS) -> None:
    """Let the operating system end this process if it takes longer than that from now on."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    _limit(resource.RLIMIT_CPU, int(used.ru_utime + used.ru_stime + seconds) + 1)


def _limit(kind: int, most: int) -> None:
    hard = resource.getrlimit(kind)[1]
    resource.setrlimit(kind, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def members(group: Hdf5Group, names: None) -> Answer:
    """Return the names of what is directly in a group."""
    return group.names(), {}


def texts(group: Hdf5Group, names: Sequence[str] | None) -> Answer:
    """Return attributes by name."""
    return group.texts(names), {}


def shapes(group: Hdf5Group, names: Sequence[str] | None) -> Answer:
    """Return the shapes of arrays by name."""
    return {name: array.shape for name, array in group.arrays(names).items()}, {}


def numbers(group: Hdf5Group, names: Sequence[str] | None) -> Answer:
    """Return shape and dtype of arrays by name, and the arrays."""
    found = group.arrays(names)
    limit_processor(CPU_SECONDS + sum(array.nbytes for array in found.values()) / BYTES_PER_SECOND)
    arrays = {name: array.read() for name, array in found.items()}
    return {name: (rows.shape, rows.dtype.str) for name, rows in arrays.items()}, arrays


_WANTED = {function.__name__: function for function in (members, texts, shapes, numbers)}


def _answer(
    files: dict[int, h5py.File], number: int, path: str, wanted: str, name: str, names: Any
) -> Answer:
    if wanted == "close":
        if number in files:
            files.pop(number).close()
        return {"value": None}, {}
    if number not in files:
        files[number] = h5py.File(path, "r")
    group = root(files[number])
    if name:
        member = group.open(name)
        if member is None:
            return {"value": None}, {}
        if not isinstance(member, Hdf5Group):
            raise ContentError(f"{name} is no group")
        group = member
    value, arrays = _WANTED[wanted](group, names)
    return {"value": value}, {key: np.ascontiguousarray(rows) for key, rows in arrays.items()}
