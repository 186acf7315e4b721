"""What notebooks show of a layout: its picture from above, or the table if there can be none."""

from __future__ import annotations

import io
from html import escape
from typing import TYPE_CHECKING

from robots import MissingPackageError

if TYPE_CHECKING:
    from layouts.arrangement import Arrangement

_MOST = 64  # robots in a picture
_NOTHING = dict.fromkeys(("Creator", "Date", "Format", "Type"))  # of its metadata


def layout_html(layout: Arrangement) -> str:
    """Return an SVG of a layout from above; its table if matplotlib is missing or it is large."""
    text = f"<pre>{escape(str(layout))}</pre>"
    if len(layout) > _MOST:
        return text
    try:
        return f'<div style="max-width: 640px">{_svg(layout)}</div>'
    except MissingPackageError:
        return text


def _svg(layout: Arrangement) -> str:
    from layouts.preview import draw  # needs NumPy and matplotlib

    figure, file = draw(layout), io.StringIO()
    from matplotlib import rc_context

    with rc_context({"svg.fonttype": "none"}):  # letters stay letters, a tenth of the size
        figure.savefig(file, format="svg", metadata=_NOTHING)
    drawn = file.getvalue()
    return drawn[drawn.index("<svg") :]
