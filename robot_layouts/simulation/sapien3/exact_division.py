"""Lets PhysX divide exactly where it clips the contacts of two boxes.

There, and nowhere else in a step of physics, PhysX takes the processor's estimate of 1 / x, of
which processors of different makers return different bits. A portable process divides instead; the
one instruction is replaced in its memory, the files stay as they are.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import re
import struct
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from robots import SimulationError

LIBRARY = "libsapien.so"

# In `calculateContacts` of PhysX 5.3.1, source/geomutils/src/pcm/GuPCMContactBoxBox.cpp, as built
# into sapien 3.0.3: an instruction before, the estimate and the one behind it, two afterwards.
_BEFORE = bytes.fromhex("66 41 0f db e9")  # pand xmm5, xmm9
_ESTIMATE = bytes.fromhex("0f 53 d4")  # rcpps xmm2, xmm4
_BEHIND = bytes.fromhex("0f 57 ff")  # xorps xmm7, xmm7
_AFTER = bytes.fromhex("0f c6 fa 23 0f c6 d7 24")  # shufps, shufps

_LOAD, _DIVIDE = bytes.fromhex("0f 28 15"), bytes.fromhex("0f 5e d4")  # movaps, divps xmm2, xmm4
_JUMP, _NOTHING = b"\xe9", b"\x90"
_ONES = struct.pack("<4f", 1, 1, 1, 1)
_READ, _WRITE, _RUN = 1, 2, 4  # rights to memory on Linux, where alone this runs
_REACH = 2**30  # of a jump, and half of it to spare (bytes)


@cache
def divide_exactly() -> None:
    """Do so from now on in this process; forks of it do so as well.

    Raises:
        SimulationError: If the library is not the one known, or the system forbids it.
    """
    place = _place() + len(_BEFORE)
    beyond = place + len(_ESTIMATE + _BEHIND)
    detour = _new_page(place)
    _write(detour, _ONES + _detour(detour + len(_ONES), beyond))
    _write(place, _jump(place, detour + len(_ONES)) + _NOTHING)


def _place() -> int:
    """Return the address of the instructions that are known.

    Raises:
        SimulationError: If there are none, or several times.
    """
    sought = _BEFORE + _ESTIMATE + _BEHIND + _AFTER
    places: list[int] = []
    for start, end in _loaded():
        held = ctypes.string_at(start, end - start)
        places += [start + found.start() for found in re.finditer(re.escape(sought), held)]
    if len(places) != 1:
        raise SimulationError(
            f"{LIBRARY} is not that of sapien 3.0.3: its estimate of 1 / x is not where it was,"
            " so physics would differ from processor to processor; install sapien 3.0.3, or begin"
            " without `robot-layouts portable`"
        )
    return places[0]


def _loaded() -> Iterator[tuple[int, int]]:
    """Yield from where to where SAPIEN's library is in memory.

    Raises:
        SimulationError: If it is not.
    """
    lines = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
    parts = [line.split(maxsplit=2) for line in lines if line.endswith(LIBRARY)]
    if not parts:
        raise SimulationError(f"{LIBRARY} is not loaded; `import sapien` loads it")
    for addresses, rights, _ in parts:
        if rights.startswith("r"):
            start, end = (int(address, 16) for address in addresses.split("-"))
            yield start, end


def _detour(at: int, beyond: int) -> bytes:
    """Return instructions at an address that divide, do what stood there, and go on behind it."""
    load = _LOAD + struct.pack("<i", -len(_ONES) - len(_LOAD) - 4)  # the ones lie just before
    body = load + _DIVIDE + _BEHIND
    return body + _jump(at + len(body), beyond)


def _jump(at: int, to: int) -> bytes:
    return _JUMP + struct.pack("<i", to - at - 5)


def _new_page(place: int) -> int:
    """Return the address of a page of memory so near to an instruction that a jump gets there.

    Raises:
        SimulationError: If there is none.
    """
    c = ctypes.CDLL(None, use_errno=True)
    c.mmap.restype = ctypes.c_void_p
    c.mmap.argtypes = [ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long]
    private = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
    for away in range(2**24, _REACH, 2**24):
        wish = (place - away) // mmap.PAGESIZE * mmap.PAGESIZE
        page = c.mmap(wish, mmap.PAGESIZE, _READ, private, -1, 0)
        if page is not None and abs(page - place) < _REACH:
            return page
        c.munmap(ctypes.c_void_p(page), ctypes.c_size_t(mmap.PAGESIZE))
    raise SimulationError(f"there is no memory free within {_REACH} bytes of {LIBRARY}")


def _write(address: int, data: bytes) -> None:
    """Write instructions.

    Raises:
        SimulationError: If the operating system does not allow it.
    """
    start = address // mmap.PAGESIZE * mmap.PAGESIZE
    size = address + len(data) - start
    _allow(start, size, _READ | _WRITE | _RUN)
    ctypes.memmove(address, data, len(data))
    _allow(start, size, _READ | _RUN)


def _allow(start: int, size: int, rights: int) -> None:
    c = ctypes.CDLL(None, use_errno=True)
    if c.mprotect(ctypes.c_void_p(start), ctypes.c_size_t(size), ctypes.c_int(rights)):
        raise SimulationError(
            "the system lets no process change its own instructions"
            f" ({os.strerror(ctypes.get_errno())}), which `robot-layouts portable` needs for one"
            " of PhysX's; let it, or begin without"
        )
