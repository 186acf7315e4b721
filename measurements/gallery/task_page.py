"""The page of a task: what is to be achieved, by whom, and how well it is known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from statistics import median
from typing import Any

from layouts import Layout
from layouts.description import action_text, decimal, facing_text
from measurements.bench.measurement import Measurement, number_text
from measurements.gallery.clip import speed
from measurements.gallery.markdown import (
    BACK,
    WIDE,
    clip_path,
    code,
    facts,
    picture,
    printed,
    quoted,
    robot_path,
    section,
    sentence,
    table,
)
from measurements.gallery.record import TaskRecord
from measurements.gallery.sources import Sources, can_be_drawn, files_of, is_optional, robots
from parity.compare.task_summary import number_text as difference_text
from robots import CONTROL_MODES, RobotDescriptor, RobotLayoutsError
from tasks import MultiRobotTask
from tasks.description import (
    action_sentence,
    action_table,
    camera_table,
    observation_table,
    read_docstring,
)
from tasks.engine.cameras import cameras_of
from tasks.registry import other_names

UP = "../"  # from a page to the gallery's folder
HERE, NATIVE = "here", "native"  # series of benchmarks
RATES = ("step", "reset", "vector")  # benchmarks by task that compare with native


def task_page(cls: type[MultiRobotTask], sources: Sources) -> Iterator[str]:
    """Yield the lines of a task's page.

    Raises:
        GalleryError: If nothing was measured of it.
    """
    text, measured = read_docstring(cls), sources.record.task(cls.task_id)
    yield from WIDE
    yield f"# {cls.task_id}"
    yield ""
    yield text.summary
    yield ""
    yield from _clip(cls, measured, sources)
    yield from facts(_facts(cls, measured, sources))
    yield ""
    yield from section("Success", _lines(sentence(text.success)))
    yield from section("What differs from episode to episode", _lines(sentence(text.randomization)))
    yield from section("Run it", _python(cls), _console(cls))
    yield from section("Who stands where", _places(cls.layout), _others(cls))
    yield from section("Action", *_action(cls.layout))
    yield from section("Observation", *_observation(measured))
    yield from section("Cameras", _cameras(cls))
    yield from section("Rewards", *_rewards(cls))
    yield from section("Control modes", *_modes(cls.layout))
    yield from section("Expert", *_expert(measured))
    yield from section("Beside ManiSkill", *_parity(cls, sources))
    yield from section("What it costs", *_costs(cls, sources))
    yield BACK


def robots_of(layout: Layout, up: str = UP) -> str:
    """Return a layout's robots in words, with links: ``2 × panda``."""
    counts = Counter(placement.robot.name for placement in layout.values())
    return " + ".join(
        f"{f'{n} × ' if n > 1 else ''}[{name}]({up}{robot_path(name)})"
        for name, n in counts.items()
    )


def expert_text(measured: TaskRecord) -> str:
    """Return how the expert did, in few words."""
    expert = measured.expert
    return f"{expert.solved} of {expert.episodes} episodes solved"


def parity_text(cls: type[MultiRobotTask], sources: Sources) -> str:
    """Return what the comparison with ManiSkill saw, in few words; empty if there was none."""
    found = sources.parity.get(cls.task_id)
    if found is None:
        return ""
    return "equal, to the last bit" if found["equal"] else "differs"


def _clip(cls: type[MultiRobotTask], measured: TaskRecord, sources: Sources) -> Iterator[str]:
    path = clip_path(cls.task_id)
    if path not in sources.pictures:
        return
    seed = measured.expert.first_solved
    times = speed(measured.expert.steps[seed], cls.scenario.control_frequency)
    pace = "real speed" if times == 1 else f"{times:g} times real speed"
    yield picture(f"{UP}{path}", f"The expert plays {cls.task_id}", height=240)
    yield ""
    yield f"The expert plays the episode of seed {seed}, shown at {pace}."
    yield ""


def _facts(
    cls: type[MultiRobotTask], measured: TaskRecord, sources: Sources
) -> Iterator[tuple[str, str]]:
    frequency = cls.scenario.control_frequency
    size = sum(entry.size for entry in measured.observation)
    yield "Robots", robots_of(cls.layout)
    yield "Action", f"{cls.layout.action_dim} numbers"
    yield "Observation", f"{size} numbers"
    yield (
        "Episode",
        f"at most {cls.max_episode_steps} steps, {frequency:g} per second"
        f" ({cls.max_episode_steps / frequency:g} s)",
    )
    yield "Rewards", quoted(cls.reward_modes)
    yield "Expert", expert_text(measured)
    yield "Beside ManiSkill", parity_text(cls, sources)
    yield "Source", cls.source
    yield "Other names", quoted(other_names(cls))


def _lines(text: str) -> Iterator[str]:
    if text:
        yield text


def _python(cls: type[MultiRobotTask]) -> Iterator[str]:
    yield from code(
        "python",
        f"""
import tasks

env = tasks.make("{cls.task_id}", num_envs=4)
obs, info = env.reset(seed=0)
obs, reward, terminated, truncated, info = env.step(env.action_space.sample())
""",
    )


def _console(cls: type[MultiRobotTask]) -> Iterator[str]:
    yield from code(
        "console",
        f"""
$ robot-layouts tasks view {cls.task_id}    # look at it in the browser
$ robot-layouts record --task {cls.task_id} --episodes 100 --out data
$ robot-layouts evaluate --task {cls.task_id}    # how often its expert succeeds
""",
    )


def _places(layout: Layout) -> Iterator[str]:
    headings = ("place", "robot", "action numbers", "base x, y, z (m)", "facing", "keyframe")
    rows = (
        (
            f"`{name}`",
            f"[{placement.robot.name}]({UP}{robot_path(placement.robot.name)})",
            f"`{action_text(layout.action_split[name])}`",
            ", ".join(map(decimal, placement.base_position)),
            facing_text(placement),
            placement.start_keyframe,
        )
        for name, placement in layout.items()
    )
    yield from table(headings, rows)


def _others(cls: type[MultiRobotTask]) -> Iterator[str]:
    """Say which other robots may stand there."""
    place, placement = next(iter(cls.layout.items()))
    if cls.robot_counts is not None:
        yield (
            f"A layout of {cls.robot_counts.start} to {cls.robot_counts.stop - 1} robots of any"
            " kind will do, in places of any names."
        )
    else:
        other = _like(placement.robot)
        yield f'Other robots take a place by its name: `robots={{"{place}": "{other}"}}`.'
    for name, needs in cls.needs.items():
        wanted = [
            *(["fingers that grasp"] if needs.fingers else []),
            *([f"a gripper that opens {needs.opening:g} m"] if needs.opening else []),
            *([f"a reach of {needs.reach:g} m"] if needs.reach else []),
            *(["a TCP that is a link"] if needs.tcp_is_link else []),
        ]
        who = "Every robot" if name == "*" else f"The robot at `{name}`"
        yield f"{who} needs {' and '.join(wanted)}."


def _like(robot: RobotDescriptor) -> str:
    """Return the name of a robot of as many numbers, with fingers if this one has some.

    Of those, one is taken whose files are at hand, and that can be drawn.
    """
    alike = [
        other
        for other in robots().values()
        if other.name != robot.name
        and other.action_dim == robot.action_dim
        and bool(other.fingers) == bool(robot.fingers)
    ]
    package = files_of(robot)[0]
    found = min(
        alike,
        key=lambda other: (
            files_of(other)[0] != package,
            is_optional(other),
            not can_be_drawn(other),
        ),
    )
    return found.name


def _action(layout: Layout) -> Iterator[Iterator[str]]:
    yield iter([f"{sentence(action_sentence(layout).removeprefix('Action, '))}."])
    yield printed(action_table(layout), quote=(1, 2))


def _observation(measured: TaskRecord) -> Iterator[Iterator[str]]:
    slices, start = dict[str, slice](), 0
    for entry in measured.observation:
        slices[entry.name] = slice(start, start + entry.size)
        start += entry.size
    sensed = {entry.name for entry in measured.observation if entry.sensed}
    yield printed(observation_table(slices, sensed.__contains__), quote=(0, 1))
    yield iter(["What a real robot senses is observed beside images, too; the rest is not."])


def _cameras(cls: type[MultiRobotTask]) -> Iterator[str]:
    yield from printed(camera_table(cameras_of(cls.layout, cls.cameras)), quote=(0,))


def _rewards(cls: type[MultiRobotTask]) -> Iterator[Iterator[str]]:
    what = {
        "dense": " ".join((cls.dense_reward.__doc__ or "").split()),
        "normalized_dense": f"the dense reward / {cls.max_reward:g}",
        "sparse": "1 on success, else 0",
        "none": "always 0",
    }
    rows = (
        (f"`{mode}`{' (default)' if mode == cls.reward_modes[0] else ''}", what[mode])
        for mode in cls.reward_modes
    )
    yield table(("reward mode", "what it gives"), rows)


def _modes(layout: Layout) -> Iterator[Iterator[str]]:
    rows: list[tuple[str, str]] = []
    for mode in CONTROL_MODES:
        try:
            driven = [placement.robot.in_control_mode(mode) for placement in layout.values()]
            rows.append((f"`{mode}`", str(sum(robot.action_dim for robot in driven))))
        except RobotLayoutsError:
            rows.append((f"`{mode}`", "–"))
    yield table(("control mode", "action numbers"), rows, numbers=(1,))
    if len(layout) > 1:
        first, second, *_ = layout
        yield iter(
            [
                "Arms may differ:"
                f' `control_mode={{"{first}": "pd_ee_delta_pose", "{second}": "pd_joint_pos"}}`.'
            ]
        )


def _expert(measured: TaskRecord) -> Iterator[Iterator[str]]:
    expert = measured.expert
    steps = expert.solved_steps
    length = f", in {min(steps)} to {max(steps)} steps (median {median(steps):g})" if steps else ""
    versions = ", ".join(f"{name} {version}" for name, version in expert.versions.items())
    yield iter(
        [
            f"It solves {100 * expert.solved / expert.episodes:g} %: {expert.solved} of the"
            f" {expert.episodes} episodes of the seeds 0 to {expert.episodes - 1}{length}."
            f" Measured with {versions}."
        ]
    )
    yield (f"- seed {seed}: {reason}" for seed, reason in expert.failed.items())


def _parity(cls: type[MultiRobotTask], sources: Sources) -> Iterator[Iterator[str]]:
    found = sources.parity.get(cls.task_id)
    if found is None:
        return
    success = found["success"]
    verdict = "Nothing differs" if found["equal"] else "Something differs"
    yield iter(
        [
            f"Played beside native ManiSkill with the same seeds and actions: {found['episodes']}"
            f" episodes, {found['steps']:,} steps, after {found['contact_steps']:,} of which a"
            f" robot touched an object. Native solved {success['native']} episodes, this library"
            f" {success['ours']}. {verdict}."
        ]
    )
    yield table(("largest difference of", ""), _differences(found), numbers=(1,))
    versions = ", ".join(f"{package} {v}" for package, v in sources.versions.items() if v)
    yield iter([f"0 is exact, to the last bit. Measured with {versions}."])


def _differences(found: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for quantity, largest in found["max_difference"].items():
        yield quantity, difference_text(largest)
    for mode, largest in found["reward"].items():
        yield f"reward, `{mode}`", difference_text(largest)


def _costs(cls: type[MultiRobotTask], sources: Sources) -> Iterator[Iterator[str]]:
    measured = [
        m
        for m in map(sources.bench.find, RATES)
        if m.variable == "task" and cls.task_id in m.values
    ]
    if not measured:
        return
    series = list(dict.fromkeys(name for m in measured for name in m.samples))
    rows = ([f"{m.title} ({m.unit})", *_medians(m, series, cls.task_id)] for m in measured)
    yield table(("", *series), rows, numbers=range(1, len(series) + 1))
    yield iter([sources.bench.conditions()])


def _medians(measurement: Measurement, series: list[str], task_id: str) -> list[str]:
    return [
        number_text(measurement.median(name, task_id)) if name in measurement.samples else "–"
        for name in series
    ]
