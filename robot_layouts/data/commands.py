"""Commands that play many episodes, to record or judge them; that record by hand; that show."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from layouts.commands import Page, Server
from robot_layouts.core.cli import Count, Folder, Seed, Word
from robot_layouts.core.commands import printable
from robot_layouts.core.pages import plural
from robot_layouts.data.playing.command_options import (
    GOES_ON,
    Acting,
    ControlMode,
    Players,
    Policy,
    RecordingOption,
    RecordingPath,
    megabytes,
    stop_signals,
    stoppable,
    tell,
)
from robot_layouts.data.reading.json_files import FILE_SIZE
from robots import RecordingError, RobotDescriptor, TaskError
from tasks.cell_options import CellOptions, PlacedRobot, chosen_robots

if TYPE_CHECKING:
    from robot_layouts.data.dataset.certificate import RecordingCertificate
    from robot_layouts.data.playing.scheduler import Event
    from robot_layouts.data.recording.record import Summary

TELEOP_FOLDER = Path("runs/teleop")


@dataclass(frozen=True, kw_only=True)
class RecordOptions(Acting):
    """Who acts, and what is written.

    Attributes:
        takeover: Policy that acts instead at every step for which it returns an action, not None.
        corrector: Policy whose action is recorded at every step beside the one that is played.
        num_envs: Episodes that each process plays at once.
        observations: Do not record what is observed, though --obs-mode is given.
        file_size: Begin another file, trajectory_0001.h5 and so on, when one is so large.
    """

    takeover: Policy | None = None
    corrector: Policy | None = None
    num_envs: Count = 1
    observations: bool = True
    file_size: Annotated[float, Word("MB", megabytes)] = FILE_SIZE


def record(
    *,
    task: str,
    episodes: Count,
    out: Folder,
    players: Players,
    seed: Seed = 0,
    options: RecordOptions,
    cell: CellOptions,
) -> int:
    """Let an expert or a policy play episodes in worker processes, and record them.

    The same command goes on where it was stopped or killed. Exit code: 0 if every episode was
    recorded, 1 if not, 2 for bad usage, 130 if interrupted. A policy maps an observation to an
    action; see robot_layouts.record. Episodes of other seeds may come from others: each says who
    acted. With --obs-mode, what is observed is recorded, too, in ManiSkill's form.

    Args:
        task: Task id; MODULE:ID for one of your own.
        episodes: Number of episodes.
        out: Folder of trajectory.h5 and .json.
        players: Who plays.
        seed: Seeds S … S + N - 1.
        options: Who acts, and what is written.
        cell: The task's robots, and what varies.

    Raises:
        RobotLayoutsError: If an option is invalid, or recording cannot go on; finished episodes are
            kept.
    """
    from robot_layouts.core.processes.start import WorkerError
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.recording.record import record as recorded

    executor, line = players.executor(), Progress(episodes, "episodes")
    kept, solved = "0 episodes are recorded", 0

    def show(summary: Summary, event: Event | None) -> None:
        nonlocal kept, solved
        kept = f"{summary.recorded} episodes are recorded"
        if event is None:
            for what in summary.damaged:
                line.say(f"{what} is damaged and does not count as recorded")
            if summary.already:
                line.say(f"{summary.already} of {episodes} episodes were recorded before")
        else:
            tell(line, event, "is not recorded")
            solved += event.result is not None and event.result[0].success
        who = f"; {len(summary.workers)} workers" if len(summary.workers) > 1 else ""
        done = summary.already + len(summary.played)
        line.update(done, f"recording (succeeded so far: {solved}{who})")

    try:
        with stoppable(lambda: f"stopped; {kept}; the same command goes on from there"), line:
            summary = recorded(
                task,
                range(seed, seed + episodes),
                out,
                executor,
                on_event=show,
                **{**options.playing(), "observations": None if options.observations else False},
                **cell.making(),
            )
    except (RecordingError, WorkerError):
        print(f"stopped; {kept}", file=sys.stderr)
        raise
    print(summary)
    return 1 if summary.failed else 0


def evaluate(
    *,
    task: str,
    episodes: Count = 100,
    players: Players,
    seed: Seed = 0,
    receipt: Annotated[Path, Word("JSON")] | None = None,
    picture_interval: Count = 1,
    keep_pictures: bool = False,
    log: Annotated[str, Word("tensorboard:DIR|wandb:PROJECT")] | None = None,
    acting: Acting,
    cell: CellOptions,
) -> None:
    """Let a policy or an expert play episodes, and print how well it does.

    A policy maps an observation to an action; see robot_layouts.evaluate. Exit code: 0 if all was
    played, 1 if not, 2 for bad usage, 130 if interrupted.

    Args:
        task: Task id; MODULE:ID for one of your own.
        episodes: Number of episodes.
        players: Who plays.
        seed: Seeds S … S + N - 1.
        receipt: Write a receipt, which `verify` plays again.
        picture_interval: The receipt has a digest of the pictures of each so many-th step.
        keep_pictures: Keep these pictures, in a folder beside the receipt.
        log: Log each episode as it ends, for TensorBoard or Weights & Biases.
        acting: Who acts, and how.
        cell: The task's robots, and what varies.

    Raises:
        RobotLayoutsError: If an option is invalid, or the policy fails.
    """
    from robot_layouts.core.progress import Progress
    from robot_layouts.data import evaluation
    from robot_layouts.data.log import opened_log

    executor, line, solved = players.executor(), Progress(episodes, "episodes"), Counter[bool]()

    with stoppable(), opened_log(log) as add, line:

        def show(event: Event) -> None:
            tell(line, event)
            if (score := event.result) is not None:
                solved[score.success] += 1
                success = solved[True] / solved.total()
                numbers = {"success": success, "return": score.total, "steps": score.steps}
                if score.stage_score is not None:
                    numbers["stage_score"] = score.stage_score
                add(solved.total(), numbers)
            line.update(solved.total(), f"evaluating (succeeded so far: {solved[True]})")

        found = evaluation.evaluate(
            task=task,
            seeds=range(seed, seed + episodes),
            executor=executor,
            receipt=receipt,
            picture_interval=picture_interval,
            keep_pictures=keep_pictures,
            on_event=show,
            **acting.playing(),
            **cell.making(),
        )
    print(found)
    if found.receipt is not None:
        print(f"{receipt}: receipt {found.receipt.hash}")
        if found.receipt.policy.get("served"):
            print("it cannot be verified without the policy's server")


def certify(
    recording: RecordingOption,
    *,
    players: Players,
    out: Annotated[Path, Word("JSON")] | None = None,
) -> int:
    """Play every episode of a recording again, and certify that every bit is the same.

    Compares states, rewards and flags of every step, and counts contacts between arms in every step
    of physics. The same command goes on where it was stopped. With --ray, every machine must find
    the recording at the same place. Exit code: 0 if everything is equal, 1 if not, 2 for bad usage,
    130 if interrupted.

    Args:
        recording: The recording.
        players: Who plays.
        out: The certificate (certificate.json beside it).

    Raises:
        RobotLayoutsError: If it cannot be certified.
    """
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.dataset.certificate import certificate_path, sentences
    from robot_layouts.data.dataset.certificate import certify as certified

    path, executor, line = recording.path, players.executor(), Progress(unit="episodes")

    def show(certificate: RecordingCertificate, event: Event | None) -> None:
        line.total = certificate.episodes
        if event is not None:
            tell(line, event, "cannot be played")
        elif certificate.checked:
            line.say(f"{len(certificate.checked)} episodes were played before")
        line.update(len(certificate.checked), f"certifying, {certificate.equal} equal")

    with stoppable(lambda: GOES_ON), line:
        certificate = certified(
            path,
            executor,
            out,
            task_id=recording.task,
            cell=recording.cell.making(),
            on_event=show,
        )
    print(printable(f"{out or certificate_path(path)}: {certificate.task}"))
    for sentence in sentences(certificate):
        print(printable(sentence))
    return 0 if certificate.holds else 1


def verify(
    receipt: Annotated[Path, Word("RECEIPT")],
    *,
    policy: Policy | None = None,
    task: Annotated[str, Word("MODULE:ID")] | None = None,
    robots: Sequence[PlacedRobot] = (),
    num_envs: Count = 1,
    episodes: Count | None = None,
    pictures: Annotated[Path, Word("DIR")] | None = None,
    players: Players,
) -> int:
    """Play the episodes of a receipt again, and compare every bit.

    Tells the first seed and step whose states differ, or pictures if policies observed some, and
    which robot files, sources, versions, drivers and parts of the processor are not those of the
    receipt. Exit code: 0 if every bit and file is the same, whatever the versions; 1 if not; 2 for
    bad usage, 130 if interrupted.

    Args:
        receipt: What `evaluate --receipt` wrote.
        policy: The policy, unless it is an expert.
        task: The task, if no installed package lists it.
        robots: Which robots these were, where the receipt cannot say it.
        num_envs: Episodes that play at once.
        episodes: Play N of them alone, drawn at random (all).
        pictures: Where to write pictures that differ (the folder NAME.differences beside the
            receipt).
        players: Who plays.

    Raises:
        RobotLayoutsError: If it cannot be played again.
    """
    from robot_layouts.core.progress import Progress
    from robot_layouts.data.receipts import verification
    from robot_layouts.data.receipts.pictures import pictures_folder
    from robot_layouts.data.receipts.provenance import episode_of
    from robot_layouts.data.receipts.receipt import Receipt

    read = Receipt.read(receipt)
    known = chosen_robots(robots) if robots else {}
    if isinstance(known, RobotDescriptor):
        known = dict.fromkeys(read.making["layout"], known)
    total = min(len(read.episodes), episodes or len(read.episodes))
    executor, line = players.executor(), Progress(total, "episodes")
    recorded = {episode.seed: episode for episode in read.episodes}
    equal = Counter[bool]()

    def show(event: Event) -> None:
        tell(line, event)
        if event.seed is not None and event.result is not None:
            equal[episode_of(event.seed, event.result) == recorded[event.seed]] += 1
        played = equal.total()
        line.update(played, f"verifying, {equal[True]} of {played} equal")

    with stoppable(), line:
        found = verification.verify(
            read,
            executor,
            show,
            policy=policy,
            task=task,
            robots=known,
            num_envs=num_envs,
            episodes=episodes,
        )
    print(printable(repr(found)))
    verdict = "equal: this is" if found.equal else "not equal: this is not"
    print(f"{verdict} what the receipt says")
    folder = pictures or receipt.with_suffix(".differences")
    for path in found.write_pictures(folder, pictures_folder(receipt)):
        print(path)
    return 0 if found.equal else 1


def teleop(
    task: str,
    *,
    seed: Seed = 0,
    out: Folder | None = None,
    policy: Policy | None = None,
    cell: CellOptions,
    control_mode: ControlMode | None = None,
    server: Server,
) -> None:
    """Steer the arms of a task in a browser, and record the episodes that you keep.

    Prints the address of the page, and serves it until Ctrl-C. Every episode that is kept is on the
    disk at once; the same command goes on with the next seed. Exit code: 0 if the page was served,
    1 if not, 2 for bad usage.

    Args:
        task: Task id; MODULE:ID for one of your own.
        seed: Seed of the first episode.
        out: Folder of trajectory.h5 and .json (runs/teleop/TASK).
        policy: Policy that acts until the user takes over an arm, as for `robot-layouts evaluate`.
        cell: The task's robots, and what varies.
        control_mode: What actions ask for (as the layout says, else pd_joint_delta_pos).
        server: Where the page is served.

    Raises:
        RobotLayoutsError: If the task cannot be made or steered, or the page cannot be served.
    """
    from layouts.viewer.server import import_viser

    import_viser()

    import tasks
    from robot_layouts.data.playing.policies import find_policy
    from robot_layouts.data.reading.recording import FILE
    from robot_layouts.data.recording.recorder import Recorder
    from robot_layouts.data.teleop.page import serve
    from robot_layouts.data.teleop.session import Session

    acting = None if policy is None else find_policy(policy)
    if isinstance(acting, str):
        raise TaskError("an expert's plan is made for what it does itself; --policy needs a policy")
    env = tasks.make(task, control_mode=control_mode, **cell.making())
    folder = out or TELEOP_FOLDER / env.task_id
    recorder = Recorder(folder / FILE, env, resume=True, source="human", source_desc="browser")
    with closing(env), recorder, stop_signals():
        for what in recorder.damaged:
            print(f"{what} is damaged and does not count as recorded", flush=True)
        session = Session(env, recorder, seed, policy=acting, policy_name=policy)
        try:
            serve(session, server.host, server.port, lambda line: print(line, flush=True))
        except KeyboardInterrupt:
            pass
        kept, total = len(session.kept), len(recorder)
        print(f"{folder / FILE}: {plural(total, 'episode')}, {kept} of them new")


def view(recording: RecordingOption, *, episode: int = 0, page: Page) -> None:
    """Look at an episode of a recording in a browser.

    Shows the recorded states; where a file holds none, the actions are played again. Exit code: 0
    if the page was served or saved, 1 if not.

    Args:
        recording: The recording.
        episode: The Nth in the file, from 0.
        page: Where it is served or saved.

    Raises:
        RobotLayoutsError: If the recording cannot be shown.
    """
    from robot_layouts.data.viewing import episode_cell

    with recording.open() as file:
        cell = recording.cell.making()
        page.show(lambda: episode_cell(file, episode, **cell))


def view_task(
    task: str,
    *,
    seed: int = 0,
    demo: RecordingPath | None = None,
    episode: int = 0,
    cell: CellOptions,
    page: Page,
) -> None:
    """Look at a task, or at a demonstration of it, in a browser.

    With --demo, it is the same as `robot-layouts view`.

    Args:
        task: Task id or another of its names; MODULE:ID for one of your own.
        seed: Seed of the reset.
        demo: Show this recording (.h5) instead.
        episode: Which episode of the recording, from 0.
        cell: The task's robots, and what varies.
        page: Where it is served or saved.

    Raises:
        RobotLayoutsError: If the task cannot be made or the recording cannot be shown.
    """
    from tasks import commands

    if demo is None:
        commands.view(task, seed=seed, cell=cell, page=page)
    elif making := cell.making():
        raise TaskError(
            f"--demo takes no --{' and no --'.join(making)}: the recording says who stands where"
        )
    else:
        view(RecordingOption(demo, task=task, cell=cell), episode=episode, page=page)
