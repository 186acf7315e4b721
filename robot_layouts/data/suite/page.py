"""The results page of runs of suites: what was played again here, side by side, and clips of it."""

from __future__ import annotations

import re
import shlex
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import mean
from typing import Any

import torch

from robot_layouts.core.pages import Tile, data_address, fragment, page, plural
from robot_layouts.core.writing import write_whole, written_whole
from robot_layouts.data.actors import EXPERT
from robot_layouts.data.dataset.contents import film_one
from robot_layouts.data.playing.evaluation_job import trace_of
from robot_layouts.data.playing.together import Casting, cast_of, record_together
from robot_layouts.data.receipts.provenance import make_again
from robot_layouts.data.receipts.receipt import EpisodeReceipt, Receipt
from robot_layouts.data.suite.checked import CheckedRun
from robot_layouts.data.suite.report import (
    ALL,
    LETTERS,
    ReportTable,
    about,
    markdown,
    parts,
    percent,
    rate,
    render_markdown,
    results_of,
)
from robot_layouts.data.suite.results import Result, result_of
from robot_layouts.data.suite.run import SuiteRun, receipt_path, write_run
from robot_layouts.data.suite.suite import Case, Suite
from robots import RobotLayoutsError, TaskError
from tasks import get_task_class
from tasks.registry import TASKS, make_scenario

PAGE, TABLES, RUNS = "index.html", "report.md", "runs"  # in the folder
STYLE = ("robot_layouts.data.suite", "suite.css")
PLAYED = (
    "Of each receipt some episodes, drawn at random, were played again for this page, and every"
    " state and file was as it says. The commands play all of them, in the folder of this page."
)
UNPLAYED = (
    "The policies of these receipts are programs of others, which this page did not run: nothing of"
    " what they say was verified here. Where the program is, the commands play the episodes again."
)
WRONG = "These were played again or read, and are not what they say."
_WIDTH, _ROW = 160, 12  # of a chart of intervals


@dataclass(frozen=True)
class RunClip:
    """How one run's policy played an episode.

    Attributes:
        words: Whose it is and how it ended.
        film: An mp4 file's bytes, and those of a jpeg of the last picture; None if there is none.
    """

    words: str
    film: tuple[bytes, bytes] | None


@dataclass(frozen=True)
class WorstSeed:
    """An episode that went badly.

    Attributes:
        case: The case's name.
        seed: The seed.
        clips: One for each run that played it.
    """

    case: str
    seed: int
    clips: tuple[RunClip, ...]


def worst_seeds(runs: Sequence[SuiteRun], count: int) -> list[tuple[Case, int]]:
    """Return the cases and seeds at which most runs failed, at most so many.

    Among seeds of a case at which as many failed, the first are those at which they came least far,
    and earned least; the worst of each case come before the second of any.
    """
    ranked: list[tuple[float, int, Case, int]] = []
    for case in runs[0].suite.cases:
        failed = sorted(_failures(case, runs))
        ranked += [(bad[0], rank, case, bad[-1]) for rank, bad in enumerate(failed)]
    ranked.sort(key=lambda found: found[:2])
    return [(case, seed) for _, _, case, seed in ranked[:count]]


def _failures(case: Case, runs: Sequence[SuiteRun]) -> Iterator[tuple[float, float, float, int]]:
    """Yield minus the share of runs that failed, how far they came, their return, and the seed."""
    receipts = [run.receipts[case.name] for run in runs if case.name in run.receipts]
    by_seed: dict[int, list[EpisodeReceipt]] = {}
    for receipt in receipts:
        for episode in receipt.episodes:
            by_seed.setdefault(episode.seed, []).append(episode)
    for seed, played in by_seed.items():
        failed = mean(not episode.success for episode in played)
        if failed:
            far = mean(episode.stage_score or 0.0 for episode in played)
            yield -failed, far, mean(episode.total for episode in played), seed


def film_worst(
    runs: Sequence[SuiteRun], count: int, progress: Callable[[str], None] = lambda what: None
) -> Iterator[WorstSeed]:
    """Yield films of the worst seeds of runs of one suite; needs a driver and imageio.

    Every episode is played again, and shown only if its states are those of its receipt.

    Args:
        runs: The runs. Policies that are no experts are imported.
        count: How many seeds.
        progress: Called before each with what is filmed.
    """
    torch.set_num_threads(1)  # as where it was played
    for case, seed in worst_seeds(runs, count):
        progress(f"filming {case.name}, seed {seed}")
        clips = [_clip(run, case, seed) for run in runs if case.name in run.receipts]
        yield WorstSeed(case.name, seed, tuple(clips))


def _clip(run: SuiteRun, case: Case, seed: int) -> RunClip:
    receipt = run.receipts[case.name]
    episode = next(one for one in receipt.episodes if one.seed == seed)
    ended = "success" if episode.success else episode.reason or "no success"
    words = f"{run.folder.name}: {ended}, {episode.steps} steps"
    try:
        film = _film(receipt, case, episode)
    except RobotLayoutsError as error:  # an expert that found no way, say
        return RunClip(f"{words}; not filmed: {error}", None)
    return RunClip(words if film else f"{words}; not filmed: it is another episode here", film)


@torch.no_grad()
def _film(receipt: Receipt, case: Case, episode: EpisodeReceipt) -> tuple[bytes, bytes] | None:
    """Return the film of an episode that was played before; None if this is another one."""
    cls, policy = get_task_class(case.task), receipt.policy
    cast, _ = cast_of(EXPERT if policy["kind"] == EXPERT else policy["name"], cls)
    making = make_again(receipt.making, receipt.environment.get("guessed", {}), cls, {})
    scenario = make_scenario(cls, **making)
    scenario.render_mode = "rgb_array"
    with closing(cls(scenario)) as env, closing(Casting(cast, env)) as casting:
        player = casting(episode.seed)
        player.most = min(player.most, episode.steps + 1)
        (played,) = record_together(env, [player])
        if trace_of(played.states).states != episode.states:
            return None
        return film_one(env, played)


def named_apart(checked: Sequence[CheckedRun]) -> list[CheckedRun]:
    """Return runs as a page keeps them: each in a folder of its own, relative to the page's."""
    taken, kept = Counter[str](), list[CheckedRun]()
    for one in checked:
        name = re.sub(r"[^\w.-]", "_", one.run.folder.resolve().name) or RUNS
        taken[name] += 1
        own = name if taken[name] == 1 else f"{name}-{taken[name]}"
        kept.append(replace(one, run=replace(one.run, folder=Path(RUNS) / own)))
    return kept


def expect_place(folder: Path) -> None:
    """Refuse a folder that holds something else than such a page.

    Raises:
        TaskError: If it does.
    """
    names = {path.name for path in folder.iterdir()} if folder.is_dir() else {folder.name}
    if folder.exists() and names and not {PAGE} <= names <= {PAGE, TABLES, RUNS}:
        raise TaskError(f"{folder} holds something else; a report needs a folder of its own")


def write_page(
    folder: Path, checked: Sequence[CheckedRun], clips: Sequence[WorstSeed] = (), remark: str = ""
) -> None:
    """Write ``index.html``, the same tables as ``report.md``, and the receipts in ``runs``.

    Args:
        folder: It appears whole or not at all, and takes the place of nothing, of an empty folder
            or of such a page.
        checked: What is shown, as `named_apart` returns it.
        clips: Films of episodes that went badly.
        remark: Why there are none, if some were asked for.

    Raises:
        TaskError: If the folder holds something else, or there are too many runs of one suite.
        UnwritableFileError: If it cannot be written.
    """
    expect_place(folder)
    with written_whole(folder, over=True) as partial:
        for one in checked:
            receipts = {**one.run.receipts, **one.unplayed}
            write_run(replace(one.run, folder=partial / one.run.folder, receipts=receipts))
        write_whole(partial / PAGE, render_page(checked, clips, remark))
        write_whole(partial / TABLES, render_tables(checked))


def render_page(
    checked: Sequence[CheckedRun], clips: Sequence[WorstSeed] = (), remark: str = ""
) -> str:
    """Return the page; see `write_page`."""
    suites = by_suite(checked)
    runs = [one.run for several in suites for one in several]
    return page(
        "robot_layouts.data.suite/report.html.jinja",
        STYLE,
        kicker="robot-layouts, results",
        title=_title(runs[0].suite) if len(suites) == 1 else f"{len(suites)} suites",
        note=about(runs) if len(suites) == 1 else plural(len(runs), "run"),
        tiles=[tile for several in suites for tile in _tiles(several)],
        parts=[
            *(part for several in suites for part in _shown(several, len(suites) > 1)),
            *(
                {"title": title, "words": words, **vars(table), "text": len(table.names)}
                for title, words, table in _apart(checked)
            ),
        ],
        worst=[
            {
                "title": f"{one.case}, seed {one.seed}",
                "clips": [
                    {
                        "words": clip.words,
                        "video": clip.film and data_address("video/mp4", clip.film[0]),
                        "poster": clip.film and data_address("image/jpeg", clip.film[1]),
                    }
                    for clip in one.clips
                ],
            }
            for one in clips
        ],
        remark=remark,
    )


def render_tables(checked: Sequence[CheckedRun]) -> str:
    """Return the tables of the page as Markdown."""
    texts = [render_markdown(runs) for several in by_suite(checked) if (runs := _listed(several))]
    for title, words, table in _apart(checked):
        rows = markdown(table, len(table.names))
        texts.append("\n".join([f"# {title}", "", words, "", *rows, ""]))
    return "\n".join(texts)


def by_suite(checked: Sequence[CheckedRun]) -> list[list[CheckedRun]]:
    """Return runs of each suite, in the order in which the first of each was given.

    Raises:
        TaskError: If there are too many of one.
    """
    found: dict[str, list[CheckedRun]] = {}
    for one in checked:
        found.setdefault(one.run.suite.hash, []).append(one)
    for runs in found.values():
        if len(runs) > len(LETTERS):
            name = _title(runs[0].run.suite)
            raise TaskError(f"{len(runs)} runs of {name} were given; {len(LETTERS)} are most")
    return list(found.values())


def command_of(receipt: Receipt, path: Path) -> str:
    """Return the command that plays all episodes of a receipt again, and compares them."""
    portable = receipt.environment["processor"].get("portable") is True
    words = [*(["robot-layouts", "portable"] if portable else []), "robot-layouts", "verify"]
    words.append(path.as_posix())
    if receipt.policy["kind"] != EXPERT:
        words += ["--policy", receipt.policy["name"]]
    if (task := receipt.task["id"]) not in TASKS:
        words += ["--task", f"{receipt.task['class'].partition(':')[0]}:{task}"]
    return shlex.join(words)


def _title(suite: Suite) -> str:
    return f"{suite.name} {suite.id}"


def _listed(checked: Sequence[CheckedRun]) -> list[SuiteRun]:
    return [one.run for one in checked if one.run.receipts]


def _tiles(checked: Sequence[CheckedRun]) -> Iterator[Tile]:
    for letter, run in zip(LETTERS, _listed(checked), strict=False):
        result = results_of([run])[ALL][0]
        assert result is not None  # it has receipts
        note = f"{result.successes:,} of {result.episodes:,}"
        if run.missing:
            note += f"; {plural(len(run.missing), 'case')} not listed"
        label = f"{letter}: success of {run.folder.name}"
        yield Tile(label, f"{percent(result.rate)} %", note)


def _shown(checked: Sequence[CheckedRun], several: bool) -> Iterator[dict[str, Any]]:
    """Yield the parts of a suite as the template takes them; see `report.parts`."""
    runs = _listed(checked)
    for title, words, table, text in parts(runs) if runs else ():
        head = f"{_title(runs[0].suite)}: {title}" if several else title
        if title == "Success":
            table, words = _results(checked, runs, table), f"{words} {PLAYED}"
        yield {"title": head, "words": words, **vars(table), "text": text}


def _results(
    checked: Sequence[CheckedRun], runs: Sequence[SuiteRun], table: ReportTable
) -> ReportTable:
    """Return the table of successes with links, commands and a chart in each row."""
    played = {one.run.folder: one.played for one in checked}
    cases = {case.name: case for case in runs[0].suite.cases}
    rows: list[tuple[str, ...]] = []
    for (name, results), row in zip(results_of(runs).items(), table.rows, strict=True):
        cells = [
            _result(run, cases.get(name), result, played[run.folder])
            for run, result in zip(runs, results, strict=True)
        ]
        rows.append((name, *cells, _chart(results), row[-1]))
    return ReportTable((*table.names[:-1], "0 to 100 %", table.names[-1]), rows)


def _result(
    run: SuiteRun, case: Case | None, result: Result | None, played: Mapping[str, int]
) -> str:
    """Return the cell of a run and a case, or of all cases."""
    if case is None or result is None:
        return rate(result)
    path, receipt = receipt_path(run.folder, case), run.receipts[case.name]
    return fragment(
        "robot_layouts.data.suite/result.html.jinja",
        rate=rate(result),
        receipt=path.as_posix(),
        played=f"{played[case.name]:,} of {result.episodes:,} played again",
        command=command_of(receipt, path),
    )


def _apart(checked: Sequence[CheckedRun]) -> Iterator[tuple[str, str, ReportTable]]:
    """Yield title, words and table of what is not listed among the results."""
    unplayed = [
        (
            one.run.folder.name,
            case.name,
            receipt.policy["name"],
            rate(result_of(receipt.episodes)),
            f"{len(receipt.episodes):,}",
            command_of(receipt, receipt_path(one.run.folder, case)),
        )
        for one in checked
        for case in one.run.suite.cases
        if (receipt := one.unplayed.get(case.name))
    ]
    if unplayed:
        names = ("run", "case", "policy", "says of its success", "episodes", "to verify it")
        yield "Not verified here", UNPLAYED, ReportTable(names, unplayed)
    wrong = [(one.run.folder.name, *item) for one in checked for item in one.wrong.items()]
    if wrong:
        yield "Not listed", WRONG, ReportTable(("run", "case", "why"), wrong)


def _chart(results: Sequence[Result | None]) -> str:
    """Return an interval for each run, drawn from 0 to 100 %."""
    whiskers = [
        {
            "place": place,
            "words": f"{LETTERS[place]}: {result.successes:,} of {result.episodes:,}",
            "y": _ROW * (place + 0.5),
            "low": _WIDTH * result.interval[0],
            "high": _WIDTH * result.interval[1],
            "rate": _WIDTH * result.rate,
        }
        for place, result in enumerate(results)
        if result is not None
    ]
    sizes = {"width": _WIDTH, "height": _ROW * len(results)}
    return fragment("robot_layouts.data.suite/intervals.svg.jinja", whiskers=whiskers, **sizes)
