"""What all pictures that matplotlib draws share: formats, colours and a blank figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robot_layouts.core.errors import MissingPackageError

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
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingPackageError(
            f"{what} needs matplotlib: pip install 'robot-layouts[preview]'"
        ) from error
    return Figure(figsize=size, dpi=dots_per_inch, facecolor="white")
