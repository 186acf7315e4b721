"""The card of a data set: what it is, how to play it again, under which licence it is shared.

Numbers of a recording (actions, states, poses) are made of none of the robots' files. Pictures and
points show their meshes, so licences that forbid commercial use hold for these, too.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib import metadata
from typing import NamedTuple

from layouts.export.files import licences_of
from robot_layouts.data.publishing.described import Described
from robot_layouts.data.reading.hub import HubError
from robots import RobotRegistry, UnknownNameError
from robots.assets import scenery
from robots.assets.manifest import load_manifest
from robots.control_modes import written_mode
from tasks import list_tasks

UNKNOWN = "unknown"
_FREE_OF_CHARGE, _ALIKE = "BY-NC", "BY-NC-SA"


class UsedFiles(NamedTuple):
    """Files that a data set was made with.

    Attributes:
        name: What they are of.
        licence: Its short name; `UNKNOWN` if they are the user's own.
        words: What it asks for.
    """

    name: str
    licence: str = UNKNOWN
    words: str = "its author's; not known here"


def parts_of(data: Described) -> list[UsedFiles]:
    """Return the files of robots and things that a data set was made with, and their licences."""
    found: list[UsedFiles] = []
    for place, about in data.layout.items():
        name = f"{about['robot']} ({place})"
        try:
            robot = RobotRegistry.load(about["robot"])
        except UnknownNameError:
            found.append(UsedFiles(name))
        else:
            found += [UsedFiles(name, *licence) for licence in licences_of(robot)]
    if not data.layout:
        found.append(UsedFiles("its robots, which the data does not name"))
    if data.task_id not in list_tasks():
        found.append(UsedFiles(f"things of the task {data.task_id}"))
    if data.pictures:
        origin = load_manifest().package(scenery.PACKAGE).origin
        words = f"{origin.licence} ({origin.licence_note})"
        found.append(UsedFiles("table and floor", origin.licence, words))
    return found


def licence_for(data: Described, wanted: str | None) -> str | None:
    """Return the licence under which a data set is shared, as the Hub writes it; None if not said.

    Args:
        data: The data set.
        wanted: What its author wants.

    Raises:
        HubError: If the licences of what its pictures show forbid that, or are not known.
    """
    if not data.pictures:
        return wanted
    shown = parts_of(data)
    what = f"the pictures of this data set ({', '.join(data.pictures)}) show"
    unknown = [part.name for part in shown if part.licence == UNKNOWN]
    if unknown and wanted is None:
        raise HubError(
            f"{what} {' and '.join(unknown)}, whose licence is not known here; if you may share"
            " them, say under which licence with --licence"
        )
    bound = [part for part in shown if _FREE_OF_CHARGE in part.licence]
    alike = any(_ALIKE in part.licence for part in bound)
    needed = "cc-by-nc-sa-4.0" if alike else "cc-by-nc-4.0"
    given = (wanted or needed).lower()
    if bound and ("nc" not in given.split("-") or (alike and given != needed)):
        listed = ", ".join(f"{part.name}, {part.licence}" for part in bound)
        raise HubError(
            f"{what} {listed}: they may not be shared under {wanted}, but under {needed}; leave"
            " --licence out, or export without pictures"
        )
    return given


def card(data: Described, name: str, licence: str | None) -> str:
    """Return the card of a data set, as the Hub's README.md.

    Args:
        data: The data set.
        name: ``OWNER/NAME`` there.
        licence: See `licence_for`.
    """
    return "\n".join([*_head(data, licence), *_body(data, name)])


def _head(data: Described, licence: str | None) -> Iterator[str]:
    yield "---"
    if licence is not None:
        yield f"license: {licence}"
    yield "task_categories: [robotics]"
    yield f"tags: [robot-layouts, {data.form if data.form != 'recording' else 'maniskill'}]"
    if data.form == "LeRobot":
        yield "configs: [{config_name: default, data_files: data/*/*.parquet}]"
    yield "---\n"


def _body(data: Described, name: str) -> Iterator[str]:
    steps = "" if data.steps is None else f", {data.steps:,} steps"
    what = "recording" if data.form == "recording" else f"{data.form} dataset"
    yield f"# {name.partition('/')[2]}\n"
    yield f"A {what} of the task `{data.task_id}`: {data.episodes:,} episodes{steps}.\n"
    yield "| | |\n| --- | --- |"
    yield f"| who acted | {' '.join(', '.join(data.sources).split())} |"
    yield f"| control mode | `{_mode(data)}` |"
    yield f"| pictures | {', '.join(data.pictures) or 'none'} |"
    yield f"| made with | robot-layouts {metadata.version('robot-layouts')} |\n"
    yield "## Layout\n"
    yield "| place | robot | position (m) | quaternion (wxyz) |\n| --- | --- | --- | --- |"
    for place, about in data.layout.items():
        where, turned = (
            ", ".join(f"{number:.4g}" for number in about[key])
            for key in ("position", "quaternion")
        )
        yield f"| {place} | `{about['robot']}` | {where} | {turned} |"
    yield "\n## Play it again\n"
    yield from _commands(data, name)
    yield "\n## Licences\n"
    yield (
        "Files of robots are not included, but needed to play it again; `robot-layouts robots"
        " fetch` brings them. They stay under their licences:\n"
    )
    yield from (f"- {part.name}: {part.words}" for part in dict.fromkeys(parts_of(data)))
    yield ""


def _mode(data: Described) -> str:
    mode = data.control_mode
    return mode if isinstance(mode, str) else written_mode(mode)


def _commands(data: Described, name: str) -> Iterator[str]:
    yield "```console"
    yield "$ pip install robot-layouts"
    if data.form == "recording":
        own = "" if data.task_id in list_tasks() else f" --task MODULE:{data.task_id}"
        yield f"$ robot-layouts replay hub:{name}{own}"
        yield f"$ robot-layouts export hub:{name} --format lerobot --out dataset"
        yield "```\n"
        yield "Every state of every step is compared with the recorded one, to the last bit."
        if any(file.startswith("certificate") for file in data.files):
            yield "`certificate.json` says that this was done, with which versions."
        return
    yield f"$ hf download {name} --repo-type dataset --local-dir dataset"
    yield "```\n"
    yield "Its episodes name the seeds with which they are recorded again."
