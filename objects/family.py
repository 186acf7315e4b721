"""Families of things: made from a few lengths, which a seed draws or a user gives."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import shake_128
from types import MappingProxyType
from typing import NamedTuple

from objects.descriptor import Grasp, NamedPoint, ObjectDescriptor
from objects.joints import Joint
from objects.shapes import Shape
from robot_layouts.core.bounds import checked_number, checked_whole
from robot_layouts.core.errors import DescriptorError, UnknownNameError
from robot_layouts.core.quoting import shown
from robots.descriptor import IDENTITY, Quaternion

SOURCE = "robot-layouts, procedural"
_DIGITS = 4  # of a drawn length: a tenth of a millimetre


class Size(NamedTuple):
    """A length of a family: that of the family's own member, and between which others lie (m)."""

    usual: float
    low: float
    high: float


class Made(NamedTuple):
    """What a family makes of its lengths; see `ObjectDescriptor` for the fields."""

    parts: Sequence[Shape]
    grasps: Sequence[Grasp] = ()
    points: Mapping[str, NamedPoint] = MappingProxyType({})
    rests: Mapping[str, Quaternion] = MappingProxyType({"upright": IDENTITY})
    joints: Sequence[Joint] = ()


@dataclass(frozen=True)
class Family:
    """Things of one kind; calling it with lengths makes one of them.

    Attributes:
        name: Its name, also that of its members.
        about: What its members are, in a few words.
        make: Makes one from its lengths, given by name.
        sizes: Its lengths by name.
        fits: Families with the same name here and lengths of the same names fit together: the lid
            of seed 7 is for the box of seed 7.
    """

    name: str
    about: str
    make: Callable[..., Made] = field(repr=False)
    sizes: Mapping[str, Size] = field(hash=False)
    fits: str

    def __call__(self, **sizes: float) -> ObjectDescriptor:
        """Make a member.

        Args:
            **sizes: Lengths (m); those that are left out are the usual ones.

        Raises:
            UnknownNameError: If the family has no such length.
            DescriptorError: If one is not between the family's bounds.
        """
        return self._made(sizes, None)

    @cached_property
    def usual(self) -> ObjectDescriptor:
        """The member with the usual lengths."""
        return self._made({}, None)

    def member(self, seed: int) -> ObjectDescriptor:
        """Return the member whose lengths a seed draws, each evenly between its bounds.

        It is the same to the last bit on every machine. The words are those of SHAKE-128, and each
        length has its own: another length of the family never changes what they are.

        Raises:
            DescriptorError: If the seed is not a whole number of at least 0.
        """
        checked_whole(f"{self.name}: seed", seed, 0, None, DescriptorError)
        return self._made({name: self._draw(seed, name) for name in self.sizes}, seed)

    def _draw(self, seed: int, name: str) -> float:
        words = shake_128(f"{self.fits}\0{seed}\0{name}".encode()).digest(8)
        (word,) = struct.unpack("<Q", words)
        _, low, high = self.sizes[name]
        return round(low + (high - low) * (word >> 11) * 2.0**-53, _DIGITS)

    def _made(self, given: Mapping[str, float], seed: int | None) -> ObjectDescriptor:
        for name in given:
            if name not in self.sizes:
                raise UnknownNameError(f"length of {self.name}", name, self.sizes)
        sizes = {
            name: checked_number(
                f"{self.name}: {name}", given.get(name, usual), low, high, DescriptorError, "m"
            )
            for name, (usual, low, high) in self.sizes.items()
        }
        made = self.make(**sizes)
        if not isinstance(made, Made):
            raise DescriptorError(
                f"the function of the family {self.name!r} gave {shown(made)}, of type"
                f" {type(made).__name__}; it must return a Made(parts, grasps, points, rests,"
                " joints)"
            )
        return ObjectDescriptor(
            name=self.name,
            about=self.about,
            parts=tuple(made.parts),
            joints=tuple(made.joints),
            rests=dict(made.rests),
            source=SOURCE,
            points=dict(made.points),
            grasps=tuple(made.grasps),
            sizes=sizes,
            seed=seed,
        )


def family(
    sizes: Mapping[str, Size], fits: str | None = None
) -> Callable[[Callable[..., Made]], Family]:
    """Make a family of a function: its name, and the first line of its docstring, are the family's.

    Args:
        sizes: The lengths that it takes, by name.
        fits: See `Family`; None if it fits no other one.

    Raises:
        DescriptorError: If the usual length of one is not between its bounds.
    """
    for name, (usual, low, high) in sizes.items():
        if not 0 < low <= usual <= high:
            raise DescriptorError(
                f"the length {name!r} of a family is usually {usual} m, from {low} to {high} m; it"
                " must be 0 < low <= usual <= high"
            )

    def declared(make: Callable[..., Made]) -> Family:
        name = make.__name__
        about = (make.__doc__ or "").partition("\n")[0].rstrip(".")
        return Family(name, about, make, dict(sizes), fits or name)

    return declared
