"""``robot-layouts objects show``: a sheet of things, each with how large and how heavy it is.

Drawn without a graphics driver: a parallel projection, the nearest triangle for each pixel.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray

from objects.descriptor import ObjectDescriptor
from objects.inspect import OBJECT, named_object
from objects.registry import ObjectRegistry
from objects.solids import surface
from robot_layouts.core.cli import File, Seed
from robot_layouts.core.errors import DescriptorError
from robot_layouts.core.figures import COLOURS, FAINT, INK, blank_figure, save_figure
from robot_layouts.kinematics.rotations import Floats, rotate, rotation_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLUMNS, PANEL = 6, (1.9, 2.1)  # of a sheet; width and height of each panel (inches)
PIXELS, SAMPLES = 220, 2  # along each side of a panel; of those, drawn for each
EYE, LIGHT = np.array([0.75, -1.0, 0.85]), np.array([0.35, -0.5, 1.0])
SHADE, MARGIN = 0.45, 0.06  # how dark what faces away is; share that stays empty on each side
HAND = 0.02  # m; length of the line behind a grasp, and of its jaws
_LINEAR = 1 / 2.2  # exponent from light to what screens encode


def show(
    objects: Sequence[Annotated[str, OBJECT]] = (),
    *,
    out: File,
    seed: Seed | None = None,
    grasps: bool = False,
) -> None:
    """Draw objects side by side; it needs no graphics driver.

    Args:
        objects: The objects (default: all that need no files of others).
        out: Picture to save (.png, .pdf, .svg).
        seed: Draws a member of each object's family (default: the usual ones).
        grasps: Draw a fork where a gripper holds an object, for each of its grasps.

    Raises:
        RobotLayoutsError: If an object does not exist, or the picture cannot be saved.
    """
    things = [named_object(name, seed) for name in objects or ObjectRegistry.names()]
    print(f"picture: {save_sheet(things, out, grasps=grasps)}")


def save_sheet(
    things: Sequence[ObjectDescriptor], path: str | os.PathLike[str], *, grasps: bool = False
) -> Path:
    """Draw things side by side and save the picture, whole or not at all.

    Args:
        things: What to draw.
        path: Where to save; the ending chooses the format (.png, .pdf or .svg).
        grasps: Whether to draw where grippers hold them: a fork for each grasp.

    Raises:
        DescriptorError: If there are no things, or the ending names no supported format.
        MissingPackageError: If matplotlib is not installed.
    """
    if not things:
        raise DescriptorError("there is nothing to draw; name one object or more")
    return save_figure(lambda: draw(things, grasps=grasps), path, "picture", DescriptorError)


def draw(things: Sequence[ObjectDescriptor], *, grasps: bool = False) -> Figure:
    """Return the figure that `save_sheet` saves; see there."""
    columns = min(len(things), COLUMNS)
    rows = ceil(len(things) / columns)
    size = PANEL[0] * columns, PANEL[1] * rows
    figure = blank_figure("the picture of an object", size)
    for i, thing in enumerate(things):
        row, column = divmod(i, columns)
        left, bottom = column / columns, 1 - (row + 1) / rows
        label = (PANEL[1] - PANEL[0]) / PANEL[1] / rows
        place = (left, bottom + label * 1.6, 1 / columns, 1 / rows - 2 * label)
        _draw_thing(figure.add_axes(place), thing, grasps=grasps)
        middle, top = left + 0.5 / columns, bottom + label * 1.4
        long = " × ".join(f"{100 * length:.2g}" for length in thing.extent)
        about = f"{long} cm, {thing.mass:.2g} kg"
        _write(figure, middle, top, thing.name, size=7.5, weight="bold", color=INK)
        _write(figure, middle, top - label * 0.75, about, size=6, color=FAINT)
    return figure


def _write(figure: Figure, x: float, y: float, words: str, **looks: Any) -> None:
    figure.text(x, y, words, ha="center", va="top", **looks)


def _draw_thing(axes: Axes, thing: ObjectDescriptor, *, grasps: bool) -> None:
    view = _view()
    corners, triangles, paints = _faces(thing)
    flat = corners @ view.T
    low, high = flat[:, :2].min(axis=0), flat[:, :2].max(axis=0)
    half = float((high - low).max()) / 2 / (1 - 2 * MARGIN)
    middle = (low + high) / 2
    picture = rasterized(flat, triangles, paints, middle, half, PIXELS * SAMPLES)
    picture = picture.reshape(PIXELS, SAMPLES, PIXELS, SAMPLES, 4).mean(axis=(1, 3))
    x, y = middle
    axes.imshow(picture, extent=(x - half, x + half, y - half, y + half), interpolation="none")
    if grasps:
        _draw_grasps(axes, thing, view)
    axes.set_xlim(x - half, x + half)
    axes.set_ylim(y - half, y + half)
    axes.set_axis_off()


def _draw_grasps(axes: Axes, thing: ObjectDescriptor, view: Floats) -> None:
    turned = np.array(thing.rest())
    for grasp in thing.grasps:
        frame = rotation_of(np.array(grasp.quaternion))
        wide, ahead = grasp.opening / 2 * frame[:, 1], HAND * frame[:, 2]
        fork = [wide, wide - ahead, -ahead, -2 * ahead, -ahead, -wide - ahead, -wide]
        points = rotate(turned, np.array(grasp.position) + np.array(fork)) @ view.T
        axes.plot(points[:, 0], points[:, 1], color=COLOURS[1], linewidth=0.5, alpha=0.7)


def _view() -> Floats:
    """Return what is to the right, up and towards the eye, a row each, (3, 3)."""
    towards = EYE / np.linalg.norm(EYE)
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


def _faces(thing: ObjectDescriptor) -> tuple[Floats, NDArray[np.intp], Floats]:
    """Return corners as it rests, (n, 3) (m), triangles, (t, 3), and their colours, (t, 3)."""
    light = LIGHT / np.linalg.norm(LIGHT)
    turned = np.array(thing.rest())
    corners: list[Floats] = []
    triangles: list[NDArray[np.intp]] = []
    paints: list[Floats] = []
    count = 0
    for part in thing.all_parts:
        if not part.visible:
            continue
        found = surface(part)
        found = found._replace(corners=rotate(turned, found.corners))
        normals = found.normals
        areas = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = normals / np.where(areas > 0, areas, 1.0)
        bright = 1 - SHADE * (1 - normals @ light) / 2
        corners.append(found.corners)
        triangles.append(found.triangles + count)
        color: Floats = np.array(part.color[:3], float) ** _LINEAR
        paints.append(bright[:, None] * color)
        count += len(found.corners)
    return np.concatenate(corners), np.concatenate(triangles), np.concatenate(paints)


def rasterized(
    corners: Floats,
    triangles: NDArray[np.intp],
    paints: Floats,
    middle: Floats,
    half: float,
    pixels: int,
) -> Floats:
    """Return what is seen of triangles, (pixels, pixels, 4): red, green, blue, and 1 where any is.

    Args:
        corners: To the right, up, and towards the eye, (n, 3).
        triangles: Three corners each, (t, 3).
        paints: Red, green and blue of each from 0 to 1, (t, 3).
        middle: Of the picture, (2,).
        half: Half its side.
        pixels: Along each side; the first row is the uppermost.
    """
    picture, depth = np.zeros((pixels, pixels, 4)), np.full((pixels, pixels), -np.inf)
    step = 2 * half / pixels
    places = (corners[:, :2] - middle + half) / step - 0.5  # pixels from the lower left one
    for (a, b, c), paint in zip(triangles, paints, strict=True):
        one, two, three = places[a], places[b], places[c]
        (ux, uy), (vx, vy) = two - one, three - one
        area = ux * vy - uy * vx
        if area <= 1e-12:  # it faces away
            continue
        low = np.maximum(np.ceil(np.minimum(np.minimum(one, two), three)), 0).astype(int)
        high = np.floor(np.maximum(np.maximum(one, two), three)).astype(int)
        high = np.minimum(high, pixels - 1)
        if (high < low).any():
            continue
        x = np.arange(low[0], high[0] + 1)[None, :] - one[0]
        y = np.arange(low[1], high[1] + 1)[:, None] - one[1]
        second, third = (x * vy - y * vx) / area, (y * ux - x * uy) / area
        near = (1 - second - third) * corners[a, 2] + second * corners[b, 2] + third * corners[c, 2]
        rows = slice(pixels - 1 - high[1], pixels - low[1])
        columns = slice(low[0], high[0] + 1)
        seen = (second >= 0) & (third >= 0) & (second + third <= 1)
        near, seen = near[::-1], seen[::-1]
        seen &= near > depth[rows, columns]
        depth[rows, columns][seen] = near[seen]
        picture[rows, columns][seen] = (*paint, 1.0)
    return np.clip(picture, 0.0, 1.0)
