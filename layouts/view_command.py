"""``python -m layouts view``, and what other rooms' ``view`` commands share with it."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING

from layouts.layout import Layout
from robots.common.commands import LOOPBACK

if TYPE_CHECKING:
    from layouts.viewer import Cell

PORT = 8080


def add_view_options(
    parser: argparse.ArgumentParser, chosen_layout: Callable[[argparse.Namespace], Layout]
) -> None:
    """Add the options of ``view`` to its parser, and what it runs.

    Args:
        parser: A parser that has the words which say what layout is meant.
        chosen_layout: Returns that layout.
    """
    add_page_options(parser)
    parser.set_defaults(call=lambda options: _run(options, chosen_layout(options)))


def add_page_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say where a page is served or saved; see `show`."""
    add_server_options(parser)
    parser.add_argument(
        "--html", metavar="FILE", help="save the page as one file instead, without sliders"
    )


def add_server_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say where a page is served."""
    parser.add_argument(
        "--host",
        default=LOOPBACK,
        metavar="ADDRESS",
        help="where to listen (%(default)s: this machine alone; 0.0.0.0: the network, too)",
    )
    parser.add_argument(
        "--port", type=int, default=PORT, metavar="N", help="port (%(default)s; 0: any free one)"
    )


def page_words(options: argparse.Namespace) -> list[str]:
    """Return the words of a command line that say what `add_page_options` read."""
    words = ["--host", options.host, "--port", str(options.port)]
    return words if options.html is None else [*words, "--html", options.html]


def show(cell: Callable[[], Cell], options: argparse.Namespace) -> int:
    """Serve or save a page as the options of `add_page_options` say; return the exit status.

    Args:
        cell: Makes what to show; called after a look whether it can be shown.
        options: What the command line says.

    Raises:
        RobotLayoutsError: If the page cannot be served or saved.
    """
    from layouts.viewer.page import serve
    from layouts.viewer.saved import NO_SLIDERS, save_html
    from layouts.viewer.server import import_viser
    from layouts.viewer.text import printable

    import_viser()

    try:
        made = cell()
        for note in made.notes:
            print(note, flush=True)
        if options.html is not None:
            print(f"page: {printable(str(save_html(made, options.html)))}\n{NO_SLIDERS}")
            return 0
        serve(made, options.host, options.port, lambda line: print(line, flush=True))
    except KeyboardInterrupt:
        print("ended")
        return 0


def _run(options: argparse.Namespace, layout: Layout) -> int:
    from layouts.viewer import Cell

    return show(lambda: Cell(" ".join([options.what, *options.robots]), layout), options)
