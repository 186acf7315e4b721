"""What all pictures that matplotlib draws share: formats, colours and a blank figure."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from robot_layouts.core.errors import RobotLayoutsError
from robot_layouts.core.importing import optional
from robot_layouts.core.writing import written_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUPPORTED = (".png", ".pdf", ".svg")

# Okabe and Ito's colours, told apart with any kind of colour vision, darkest first; then two of
# Paul Tol's.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#882255", "#999933")
INK, FAINT = "#2B2B2B", "#8A8A8A"
DOTS_PER_INCH = 150


def blank_figure(
    what: str, size: tuple[float, float], dots_per_inch: int = DOTS_PER_INCH
) -> Figure:
    """Return a white figure to draw on.

    Args:
        what: What it becomes, in words.
        size: Width and height (inches).
        dots_per_inch: Resolution.

    Raises:
        MissingPackageError: If matplotlib is not installed.
    """
    matplotlib = optional("matplotlib.figure", f"{what} needs matplotlib", "preview")
    return matplotlib.Figure(figsize=size, dpi=dots_per_inch, facecolor="white")


def save_figure(
    drawn: Callable[[], Figure],
    path: str | os.PathLike[str],
    what: str,
    error: type[RobotLayoutsError],
) -> Path:
    """Save a figure, whole or not at all, and return its path.

    Args:
        drawn: Draws it; called if the name will do.
        path: Where to save; the ending chooses the format (.png, .pdf or .svg).
        what: What it is, for the message.
        error: What is raised.

    Raises:
        RobotLayoutsError: If the ending names no supported format.
    """
    target = Path(path)
    if target.suffix.lower() not in SUPPORTED:
        raise error(
            f"cannot save a {what} as {target.name!r}; the name must end in"
            f" {', '.join(SUPPORTED[:-1])} or {SUPPORTED[-1]}"
        )
    figure = drawn()
    with written_whole(target) as unfinished:
        figure.savefig(unfinished, format=target.suffix[1:].lower())
    return target
