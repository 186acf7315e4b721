"""Plays the episodes of a receipt again, and names what is not the same: seed, step, and why."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from os import PathLike
from pathlib import Path
from random import SystemRandom
from shlex import quote
from typing import Any

import numpy as np

from layouts.placement import RobotLike
from robot_layouts.core.bounds import checked_whole
from robot_layouts.core.quoting import cut
from robot_layouts.data.actors import EXPERT
from robot_layouts.data.playing.evaluation_job import (
    BYTES,
    EvaluationJob,
    Images,
    TracedScore,
    WatchedPictures,
    scores_of,
)
from robot_layouts.data.playing.executor import Executor, choose_executor
from robot_layouts.data.playing.replay import first_row
from robot_layouts.data.playing.scheduler import Event
from robot_layouts.data.playing.together import cast_of, grouped
from robot_layouts.data.receipts.pictures import (
    PictureDifference,
    kept,
    side_by_side,
    write_png,
)
from robot_layouts.data.receipts.provenance import describe_job, make_again, receipt_of
from robot_layouts.data.receipts.receipt import EpisodeReceipt, Receipt, ReceiptError
from robots import RobotLayoutsError
from tasks import MultiRobotTask, get_task_class
from tasks.episode import Policy
from tasks.registry import TASKS, make_scenario

_SHOWN = 60  # characters of a value
_DIGITS = 12  # of a SHA-256
_Path = tuple[str, ...]  # keys of a receipt's json
_NAMED = 10  # episodes that a text names
_NO_PICTURES = np.zeros((0, BYTES), np.uint8)


@dataclass(frozen=True)
class EpisodeDifference:
    """An episode that was not the same.

    Attributes:
        seed: Its seed.
        step: The first control step after which the states differ, 0 being the reset; None if the
            states are the same and only other fields are not.
        recorded: The episode in the receipt.
        here: The episode that was played here.
        pictures: The pictures that differ, those of the first moment first.
    """

    seed: int
    step: int | None
    recorded: EpisodeReceipt
    here: EpisodeReceipt
    pictures: tuple[PictureDifference, ...] = ()

    def __str__(self) -> str:
        """Name the step, and all that differs besides."""
        where = "states differ after the reset already" if self.step == 0 else "states are the same"
        if self.step:
            where = f"states differ from step {self.step} on"
        fields = {"steps": "steps", "success": "success", "return": "total", "reason": "reason"}
        fields["stage score"] = "stage_score"
        pairs = {n: (getattr(self.recorded, f), getattr(self.here, f)) for n, f in fields.items()}
        others = [
            f"{name} {_or_none(before)} in the receipt, {_or_none(now)} here"
            for name, (before, now) in pairs.items()
            if before != now
        ]
        return "; ".join([f"seed {self.seed}: {where}", *map(str, self.pictures), *others])


@dataclass(frozen=True)
class Change:
    """Something that episodes depend on, and that is not what the receipt says.

    Attributes:
        about: ``"version"``, ``"processor"``, ``"graphics"``, ``"file"`` (of a robot),
            ``"policy"``, ``"task"``, ``"making"``, ``"variable"`` (of the environment) or
            ``"receipt"``.
        name: Which.
        recorded: What the receipt says; None if nothing.
        here: What it is here; None if it does not exist.
    """

    about: str
    name: str
    recorded: Any
    here: Any

    def __str__(self) -> str:
        """Name it, with both values."""
        return f"{self.name}: {_shown(self.recorded)} in the receipt, {_shown(self.here)} here"


def episode_differences(
    recorded: Receipt, here: Receipt, images: Mapping[int, Images]
) -> Iterator[EpisodeDifference]:
    """Yield the episodes that are not the same, in the order of the receipt; both have all.

    Args:
        recorded: The receipt.
        here: That of what was played here.
        images: By seed, the first picture of each camera and texture that differs.
    """
    played = {episode.seed: episode for episode in here.episodes}
    interval = recorded.pictures.get("interval", 1)
    for before in recorded.episodes:
        now, seed = played[before.seed], before.seed
        if before != now:
            drawn = _picture_differences(before, now, interval, images.get(seed, {}))
            pictures = sorted(drawn, key=lambda one: before.steps if one.step is None else one.step)
            step = first_step(before, now)
            yield EpisodeDifference(seed, step, before, now, tuple(pictures))


def _picture_differences(
    before: EpisodeReceipt, now: EpisodeReceipt, interval: int, images: Images
) -> Iterator[PictureDifference]:
    then, drawn = before.picture_digests(), now.picture_digests()
    for name in dict.fromkeys([*then, *drawn]):
        if before.pictures.get(name) == now.pictures.get(name):
            continue
        old, new = then.get(name, _NO_PICTURES), drawn.get(name, _NO_PICTURES)
        compared = min(len(old), len(new))
        different = np.flatnonzero((old[:compared] != new[:compared]).any(1))
        first = int(different[0]) * interval if len(different) else None
        here = next(iter(images.get(name, {}).values()), None)
        yield PictureDifference(name, first, len(different), compared, here)


def first_step(before: EpisodeReceipt, now: EpisodeReceipt) -> int | None:
    """Return the first step that differs; the last one if the short digests are equal."""
    if before.states == now.states:
        return None
    row = first_row(before.digests(), now.digests())
    return min(before.steps, now.steps) if row is None else row


def changes(recorded: Receipt, here: Receipt) -> Iterator[Change]:
    """Yield whatever else is not the same, each named."""
    if not recorded.untouched:
        name = "the receipt was changed after it was written: its SHA-256"
        yield Change("receipt", name, recorded.claimed, recorded.hash)
    for part in ("task", "policy", "making", "environment"):
        before, now = (dict(_leaves(getattr(each, part), (part,))) for each in (recorded, here))
        for path in dict.fromkeys([*before, *now]):
            if before.get(path) != now.get(path) and (what := _named(path, recorded)):
                yield Change(*what, before.get(path), now.get(path))


def _named(path: _Path, receipt: Receipt) -> tuple[str, str] | None:
    """Return what a leaf of a receipt is about, and its name; None if it is of no consequence."""
    match path:
        case ("task", *rest):
            module = receipt.task["class"].partition(":")[0]
            return "task", f"task {receipt.task['id']}, {_source(rest, module)}"
        case ("policy", *rest):
            kind, name = receipt.policy["kind"], receipt.policy["name"]
            return "policy", f"{kind} {name}, {_source(rest, name.partition(':')[0])}"
        case ("making", "layout", place, "files", *file):
            robot = receipt.making["layout"].get(place, {}).get("robot", "another")
            return "file", f"file {'/'.join(file)} of the robot {place} ({robot})"
        case ("making", "layout", place, "descriptor"):
            return "making", f"descriptor of the robot {place}"
        case ("making", *rest):
            return "making", ".".join(rest)
        case ("environment", "graphics", name):
            return "graphics", f"graphics, {name}"
        case ("environment", "variables"):
            return "variable", "environment variables that the policy reads"
        case ("environment", "versions", package):
            return "version", f"version of {package}"
        case ("environment", "processor", name):
            return "processor", f"processor, {name}"
        case _:
            return None


def _source(path: list[str], module: str) -> str:
    if path == ["sha256"]:
        return f"source of the module {module}"
    words = {"also": "source of the module", "files": "file", "weights": "weights of"}
    return " ".join([words.get(path[0], path[0]), *path[1:]])


def _leaves(
    about: Mapping[str, Any], path: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], Any]]:
    for name, value in about.items():
        if isinstance(value, dict) and value:
            yield from _leaves(value, (*path, name))
        else:
            yield (*path, name), value


def _or_none(value: Any) -> Any:
    return "none" if value == "" else value


def _shown(value: Any) -> str:
    if value is None:
        return "nothing"
    text = str(value)
    if len(text) == 64 and " " not in text:
        return f"{text[:_DIGITS]}…"
    return cut(text, _SHOWN)


@dataclass(frozen=True)
class Verification:
    """The result of playing the episodes of a receipt again.

    Attributes:
        receipt: The receipt.
        here: The receipt of what was played here.
        images: By seed, the first picture of each camera and texture that differs, as drawn here.
    """

    receipt: Receipt
    here: Receipt
    images: Mapping[int, Images] = field(default_factory=dict[int, Images], compare=False)

    @property
    def equal(self) -> bool:
        """Whether all is the same but, perhaps, the environment: every bit, and every file."""
        return self.receipt.untouched and self.receipt.hash == self.here.hash

    @cached_property
    def differences(self) -> tuple[EpisodeDifference, ...]:
        """The episodes that were not the same, in the receipt's order."""
        return tuple(episode_differences(self.receipt, self.here, self.images))

    @cached_property
    def changed(self) -> tuple[Change, ...]:
        """What they depend on and is not as in the receipt: versions, files, processor, …."""
        return tuple(changes(self.receipt, self.here))

    def write_pictures(
        self, folder: str | PathLike[str], kept_in: str | PathLike[str] | None = None
    ) -> list[Path]:
        """Write the first picture of each camera and texture that differs, of some episodes.

        Where the picture of then was kept, it is on the left, that of now beside it, and on the
        right, in white, the pixels that differ. Otherwise it is the picture of now alone.

        Args:
            folder: Where to write png files.
            kept_in: The folder of the pictures of then, NAME.pictures beside NAME.json. Of these
                only such are shown as have the receipt's digests.

        Returns:
            The files; none if no picture differs.

        Raises:
            UnwritableFileError: If they cannot be written.
        """
        interval, written = self.receipt.pictures.get("interval", 1), list[Path]()
        for episode in self.differences[:_NAMED]:
            for one in episode.pictures:
                if one.here is None or one.step is None:
                    continue
                then = None
                if kept_in is not None:
                    trace = episode.recorded.picture_trace(one.name)
                    rows = kept(Path(kept_in), episode.seed, one.name, trace)
                    then = None if rows is None else rows[one.step // interval]
                pixels = side_by_side(one.name, then, one.here)
                if pixels is not None:
                    name = re.sub(r"[^\w.-]", "_", one.name)
                    path = Path(folder) / f"seed_{episode.seed}_step_{one.step}_{name}.png"
                    write_png(path, pixels)
                    written.append(path)
        return written

    def __repr__(self) -> str:
        """Show it as a few lines."""
        receipt, total = self.receipt, len(self.receipt.episodes)
        lines = [
            f"{receipt.task['id']}, {receipt.policy['name']}: {total - len(self.differences)} of"
            f" {total} episodes equal to the last bit",
            *map(str, self.differences[:_NAMED]),
        ]
        if more := len(self.differences[_NAMED:]):
            lines.append(f"and {more} episodes more")
        if self.changed:
            lines += ["not as in the receipt:", *(f"  {change}" for change in self.changed)]
        return "\n".join(lines)


def verify(
    receipt: Receipt | str | PathLike[str],
    executor: Executor | None = None,
    on_event: Callable[[Event], None] = lambda event: None,
    *,
    workers: int | None = None,
    policy: Policy | str | None = None,
    task: str | None = None,
    robots: Mapping[str, RobotLike] | None = None,
    num_envs: int = 1,
    episodes: int | None = None,
) -> Verification:
    """Play the episodes of a receipt again, and compare everything.

    A receipt does not choose which code runs: experts play, and tasks that this library or an
    installed package lists. Any other policy or task has to be named, and its module is compared
    with the receipt's afterwards. No episode is played further than one step beyond the receipt's.

    Args:
        receipt: A receipt, or its file.
        executor: Who plays; None: as many processes as ``workers`` says.
        on_event: Called with each event of the executor, to show progress.
        workers: How many processes play; None: one for each core that this process may use; 0:
            none, but this one.
        policy: The policy, unless it is an expert: as `robot_layouts.data.evaluate` takes it.
        task: The task, ``module:Id``, if no installed package lists it and its module has not been
            imported yet.
        robots: Which robots these were, by place, where the receipt cannot say it.
        num_envs: How many episodes each process plays at once. Those of a batched policy are
            played as many at once as when the receipt was written.
        episodes: Play so many of the receipt's alone, drawn at random; a few more where a batched
            policy played several at once. None: all.

    Raises:
        ReceiptError: If it is no receipt or cannot be read, or its task or policy is not available
            here or has to be named.
        TaskError: If something is given that is no policy, or both ``workers`` and an executor.
        AssetError: If robot files cannot be found.
        WorkerError: If the policy raised something, or workers die of it again and again.
    """
    recorded = receipt if isinstance(receipt, Receipt) else Receipt.read(receipt)
    with _naming_variables(recorded):
        checked_whole("num_envs", num_envs, 1, None, ReceiptError)
        if episodes is not None:
            checked_whole("episodes", episodes, 1, None, ReceiptError)
        cls = _task(recorded, task)
        if policy is None:
            _expect_policy(recorded)
        cast, name = cast_of(EXPERT if policy is None else policy, cls)
        guessed = recorded.environment.get("guessed", {})
        making = make_again(recorded.making, guessed, cls, robots or {})
        if episodes is not None:
            recorded = _some_of(recorded, episodes)
        seeds = [episode.seed for episode in recorded.episodes]
        at_once = recorded.making.get("num_envs", min(num_envs, len(seeds)))
        scenario = make_scenario(cls, at_once, **making)
        try:
            scenario.check(cls.reward_modes)
        except RobotLayoutsError as error:
            raise ReceiptError(f"the receipt's task cannot be made here: {error}") from error
        most_steps = {episode.seed: episode.steps + 1 for episode in recorded.episodes}
        together = grouped(seeds, at_once)
        watched = _watched(recorded)
        job = EvaluationJob(cls, scenario, cast, together, True, most_steps, watched)
        described, images = describe_job(job, name), dict[int, Images]()

        def look(event: Event) -> None:
            if event.seed is not None and isinstance(event.result, TracedScore):
                images[event.seed] = event.result.images
            on_event(event)

        scores = scores_of(choose_executor(workers, executor), job, look)
        here = receipt_of(described, job, {seed: scores[seed] for seed in seeds})
        return Verification(recorded, here, images)


def _some_of(receipt: Receipt, episodes: int) -> Receipt:
    """Return a receipt of some of its episodes; what was played at once stays together."""
    at_once = receipt.making.get("num_envs", 1)
    groups = [*grouped([episode.seed for episode in receipt.episodes], at_once).values()]
    drawn = SystemRandom().sample(groups, min(len(groups), -(-episodes // at_once)))
    chosen = tuple(one for one in receipt.episodes if one.seed in {*chain(*drawn)})
    return replace(receipt, episodes=chosen, claimed="" if receipt.untouched else receipt.claimed)


def _watched(receipt: Receipt) -> WatchedPictures | None:
    """Return which pictures to compare; None if the receipt has no digests of any."""
    if not receipt.pictures:
        return None
    expected = {episode.seed: episode.picture_digests() for episode in receipt.episodes}
    return WatchedPictures(receipt.pictures["interval"], expected=expected)


@contextmanager
def _naming_variables(receipt: Receipt) -> Generator[None]:
    """Let every error of this library name the policy's variables that are not set here."""
    try:
        yield
    except RobotLayoutsError as error:
        names = receipt.environment.get("variables", "").split()
        if unset := [name for name in names if name not in os.environ]:
            hint = (
                "environment variables that were set when the receipt was written, and are not here"
            )
            error.args = (f"{error}; {hint}: {', '.join(unset)}", *error.args[1:])
        raise


def _task(receipt: Receipt, name: str | None) -> type[MultiRobotTask]:
    """Return the class of a receipt's task."""
    recorded, module = receipt.task["id"], receipt.task["class"].partition(":")[0]
    if name is None and recorded not in TASKS:
        raise ReceiptError(
            f"the receipt is of the task {recorded}, which nothing installed lists, and a receipt"
            f" does not choose which code runs; to play what is here, type:"
            f" --task {quote(f'{module}:{recorded}')}"
        )
    cls = get_task_class(name or recorded)
    if name is not None and cls.task_id != recorded:
        raise ReceiptError(f"the receipt is of {recorded}, not of {cls.task_id}")
    return cls


def _expect_policy(receipt: Receipt) -> None:
    """Refuse a receipt of another player than an expert."""
    kind, name = receipt.policy["kind"], receipt.policy["name"]
    if kind == EXPERT:
        return
    if receipt.policy.get("served") is True:
        raise ReceiptError(
            f"the receipt is of a policy that {name} served, and nothing but that server can verify"
            f" it; where it, or another that serves the same, runs, type: --policy {quote(name)}"
        )
    if receipt.policy.get("importable") is not True:
        raise ReceiptError(
            f"the receipt's policy {name} was no variable of a module, and cannot be imported"
            " again; pass it to robot_layouts.data.receipts.verify as policy=…"
        )
    raise ReceiptError(
        f"the receipt is of the policy {name}, and a receipt does not choose which code runs; to"
        f" play what is here, type: --policy {quote(name)}"
    )
