"""The gallery's first page: a card for every task and every robot."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from measurements.gallery.markdown import (
    WIDE,
    breakable,
    clip_path,
    picture,
    portrait_path,
    robot_path,
    task_path,
)
from measurements.gallery.sources import Sources, kind, robots, summary, task_classes
from measurements.gallery.task_page import expert_text, parity_text, robots_of
from robots import RobotDescriptor
from tasks import MultiRobotTask
from tasks.description import read_docstring

KINDS = {
    "arm": "Robots of one arm",
    "several arms": "Robots of two arms",
    "humanoid": "Humanoids",
    "hand": "Hands",
}
# How many cards stand beside each other on a phone and on a wide screen: 1 and 3, or 2 and 5.
LARGE = "grid-template-columns: repeat(auto-fill, minmax(min(100%, 13rem), 1fr))"
SMALL = "grid-template-columns: repeat(auto-fill, minmax(min(45%, 8rem), 1fr))"


def index_page(sources: Sources) -> Iterator[str]:
    """Yield the lines of the page.

    Raises:
        GalleryError: If nothing was measured of a task.
    """
    tasks, every = task_classes(), robots()
    clones = {task_id: cls for task_id, cls in tasks.items() if cls.native_id}
    own = {task_id: cls for task_id, cls in tasks.items() if task_id not in clones}
    yield from WIDE
    yield "# Gallery"
    yield ""
    yield (
        f"{len(tasks)} tasks and {len(every)} robots come with the library. In each clip an expert,"
        " a script, plays the task. Other robots can take the places of a task, and robots and"
        " tasks of your own stand beside these."
    )
    yield ""
    for title, chosen in {"Tasks of our own": own, "Tasks that clone ManiSkill's": clones}.items():
        yield from _section(title, (_task_card(cls, sources) for cls in chosen.values()), LARGE)
    for name, title in KINDS.items():
        alike = [robot for robot in every.values() if kind(robot) == name]
        yield from _section(title, (_robot_card(robot, sources) for robot in alike), SMALL)
    yield "Written from the code and its records by `python -m measurements.gallery`."


def _section(title: str, cards: Iterable[Iterator[str]], style: str) -> Iterator[str]:
    yield f"## {title}"
    yield ""
    yield f'<div class="grid cards" style="{style}" markdown>'
    yield ""
    for card in cards:
        yield from card
    yield "</div>"
    yield ""


def _task_card(cls: type[MultiRobotTask], sources: Sources) -> Iterator[str]:
    page, path = task_path(cls.task_id), clip_path(cls.task_id)
    measured = sources.record.task(cls.task_id)
    shown = picture(path, f"Clip of {cls.task_id}", height=240, lazy=True)
    compared = parity_text(cls, sources)
    beside = f" Beside ManiSkill: {compared}." if compared else ""
    lines = [
        *([f"[{shown}]({page})"] if path in sources.pictures else []),
        f"**[{cls.task_id}]({page})**",
        read_docstring(cls).summary,
        f"{robots_of(cls.layout, up='')}, {cls.layout.action_dim} action numbers.",
        f"Expert: {expert_text(measured)}.{beside}",
    ]
    yield from _card(lines)


def _robot_card(robot: RobotDescriptor, sources: Sources) -> Iterator[str]:
    page, path = robot_path(robot.name), portrait_path(robot.name)
    shown = picture(path, f"Picture of {robot.name}", lazy=True)
    lines = [
        *([f"[{shown}]({page})"] if path in sources.pictures else []),
        f"**[{breakable(robot.name)}]({page})**",
        summary(robot.name),
    ]
    yield from _card(lines)


def _card(paragraphs: list[str]) -> Iterator[str]:
    """Yield the lines of an entry of a list, whose paragraphs are indented."""
    first, *others = paragraphs
    yield f"-   {first}"
    yield ""
    for paragraph in others:
        yield f"    {paragraph}"
        yield ""
