"""Masses and inertias of a URDF, refused where physics could not use them."""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element

from robots.common.errors import AssetError
from robots.urdf.numbers import numbers_of, required_numbers

MOMENTS = ("ixx", "iyy", "izz")
PRODUCTS = ("ixy", "ixz", "iyz")
_ROUNDING = 1e-12
SMALLEST = 1e-30  # kg, kg·m²; below it, what physics divides by leaves single precision


def expect_inertia(link: Element, where: str, *, moves: bool) -> None:
    """Refuse a link whose ``<inertial>`` is incomplete, or describes no body.

    A link may leave ``<inertial>`` out, or give nothing but zeros: then SAPIEN takes mass and
    inertia from the collision shapes. A link that a joint moves must then have no shape at all:
    that is how URDFs put two joints in one place.

    Args:
        link: The ``<link>``.
        where: The URDF and the link, for messages.
        moves: Whether a joint moves it.

    Raises:
        AssetError: If a number is missing or none, a mass or moment is not positive, or the
            tensor is not that of a body.
    """
    inertial = link.find("inertial")
    if inertial is None:
        return
    for key in ("xyz", "rpy"):
        numbers_of(inertial.find("origin"), key, (0.0, 0.0, 0.0), where)
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    if mass is None or tensor is None:
        lacks = "<mass>" if mass is None else "<inertia>"
        raise AssetError(
            f"{where} has an <inertial> without {lacks}; give both, or leave <inertial> out"
        )
    (weight,) = required_numbers(mass, "value", 1, where)
    moments, products = (
        [required_numbers(tensor, key, 1, where)[0] for key in keys] for keys in (MOMENTS, PRODUCTS)
    )
    shapes = link.find("collision") is not None or link.find("visual") is not None
    nothing = weight == 0 or not any((*moments, *products))
    if nothing and weight >= 0 and (not moves or not (shapes or any((weight, *moments)))):
        return
    if weight < SMALLEST or min(moments) < SMALLEST:
        listing = ", ".join(f"{moment:g}" for moment in moments)
        raise AssetError(
            f"{where}{' moves, but' if moves else ''} has mass {weight:g} kg and moments of inertia"
            f" {listing} kg·m²; all must be positive (leave <inertial> out, and they follow from"
            " the collision shapes)"
        )
    if not _is_positive(moments, products):
        listing = ", ".join(f"{number:g}" for number in (*moments, *products))
        raise AssetError(
            f"{where} has the inertia ixx, iyy, izz, ixy, ixz, iyz = {listing} kg·m², which no body"
            " has: around some axis it is not positive (are the signs or the units wrong?)"
        )


def _is_positive(moments: list[float], products: list[float]) -> bool:
    """Tell whether a symmetric matrix is positive definite, by Cholesky's decomposition."""
    (xx, yy, zz), (xy, xz, yz) = moments, products
    scale = max(moments)
    a = math.sqrt(xx / scale)
    b, c = xy / scale / a, xz / scale / a
    if (d := yy / scale - b * b) <= _ROUNDING:
        return False
    e = (yz / scale - b * c) / math.sqrt(d)
    return zz / scale - c * c - e * e > _ROUNDING
