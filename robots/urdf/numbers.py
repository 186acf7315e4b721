"""Numbers in the attributes of a URDF."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any
from xml.etree.ElementTree import Element

from robots.common.errors import AssetError

# Beyond it, squares and quotients leave the range of single precision, in which physics computes.
LARGEST = 1e18
LARGEST_LENGTH = 1e4  # m

# As C and Python both read it; Python alone also takes 1_000 and the digits of other scripts.
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")


def numbers_of(
    element: Element | None,
    attribute: str,
    default: tuple[float, ...],
    where: str,
    largest: float | None = None,
) -> Any:
    """Return the finite numbers of an attribute, as many as ``default`` has.

    Args:
        element: The element, or None for the default.
        attribute: Its attribute.
        default: What it means to leave the attribute out.
        where: What the element belongs to, for messages.
        largest: The largest amount of a number; None is `LARGEST_LENGTH` for ``xyz``, else
            `LARGEST`.

    Raises:
        AssetError: If there are more or fewer numbers, or some that are none, not finite, or
            larger.
    """
    if element is None or element.get(attribute) is None:
        return default
    return required_numbers(element, attribute, len(default), where, largest)


def required_numbers(
    element: Element, attribute: str, count: int, where: str, largest: float | None = None
) -> tuple[float, ...]:
    """Return the numbers of an attribute that cannot be left out; see `numbers_of`.

    Raises:
        AssetError: If it is left out, or as `numbers_of`.
    """
    text = element.get(attribute)
    need = f"{count} finite number{'s are' if count > 1 else ' is'} needed"
    if text is None:
        raise AssetError(f"{where} has no {attribute} in <{element.tag}>; {need}")
    parts = text.split()
    known = text.isascii() and all(map(_NUMBER.fullmatch, parts))
    numbers = tuple(map(float, parts)) if known else ()
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise AssetError(f"{where} has {attribute}={shown(text)} in <{element.tag}>; {need}")
    if largest is None:
        largest = LARGEST_LENGTH if attribute == "xyz" and element.tag == "origin" else LARGEST
    if max(map(abs, numbers)) > largest:
        raise AssetError(
            f"{where} has {attribute}={shown(text)} in <{element.tag}>; {largest:g} is the largest"
            " amount that makes sense"
        )
    return numbers


def expect_numbers(element: Element, counts: Mapping[str, Mapping[str, int]], where: str) -> None:
    """Refuse attributes of an element's parts that are not so many finite numbers.

    Args:
        element: The element.
        counts: For each of its parts, how many numbers each attribute has; all may be left out.
        where: What the element belongs to, for messages.

    Raises:
        AssetError: As `numbers_of`.
    """
    for part, attributes in counts.items():
        for attribute, count in attributes.items():
            numbers_of(element.find(part), attribute, (0.0,) * count, where)


def shown(text: str) -> str:
    """Return a text of the file as a message shows it: quoted, and not too long."""
    return repr(text if len(text) <= 60 else f"{text[:60]}…")
