"""``rl.view``: a layout, an environment or a recording in a browser."""

from __future__ import annotations

from os import PathLike, fspath
from pathlib import Path

from layouts import Layout
from layouts.commands import Page
from layouts.viewer import ShownCell
from robot_layouts.core.commands import LOOPBACK
from robot_layouts.data.commands import episode_cell
from robot_layouts.data.playing.replay import open_recording
from robot_layouts.data.reading.recording import Recording
from tasks import TaskEnv
from tasks.view import task_cell


def view(
    shown: Layout | TaskEnv | Recording | str | PathLike[str],
    *,
    episode: int = 0,
    html: str | PathLike[str] | None = None,
    host: str = LOOPBACK,
    port: int = 8080,
) -> None:
    """Show a layout, an environment or a recording as a page in the browser.

    Prints the page's address, and serves it until Ctrl-C. Needs the extra ``view``.

    Args:
        shown: A layout; an environment, which is shown as it stands now; or a recording: what
            `record` returned, its folder, one of its files, or one that is open.
        episode: Which episode of a recording, from 0.
        html: Save the page as this file instead, without sliders for joints.
        host: Where to listen; 127.0.0.1 is this machine alone, 0.0.0.0 the network, too.
        port: Port; 0 takes any free one.

    Raises:
        MissingPackageError: If viser is not installed.
        TrajectoryError: If there is no such recording or episode, or it cannot be played.
        ViewerError: If the page cannot be served or saved.
    """
    page = Page(host=host, port=port, html=None if html is None else fspath(html))
    if isinstance(shown, Layout):
        robots = ", ".join(f"{name} {placed.robot.name}" for name, placed in shown.items())
        page.show(lambda: ShownCell(robots, shown))
    elif isinstance(shown, TaskEnv):
        page.show(lambda: task_cell(shown, shown.task_id))
    elif isinstance(shown, Recording):
        page.show(lambda: episode_cell(shown, episode))
    else:
        with open_recording(Path(shown), None) as recording:
            page.show(lambda: episode_cell(recording, episode))
