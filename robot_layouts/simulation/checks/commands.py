"""``robot-layouts robots inspect`` and ``objects inspect``, which also try things in physics."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

from objects import ObjectDescriptor
from objects.inspect import OBJECT, named_object, report
from robot_layouts.core.cli import File, Seed, Word
from robot_layouts.core.errors import DescriptorError
from robot_layouts.simulation.checks.grasp import GraspTrial, try_grasps
from robot_layouts.simulation.checks.objects import OPENINGS, try_rests, try_thing_grasps
from robot_layouts.simulation.checks.tcp_control import TcpTrial, try_tcp_control
from robot_layouts.simulation.checks.trial import (
    HELD,
    Fastest,
    NumberTrial,
    Trial,
    in_itself,
    percent,
    try_robot,
)
from robots import RobotDescriptor
from robots import inspect as reports
from robots.named import FORMS, guessed_robot, is_path, named_robot
from robots.picture import save_picture

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

STEPS = 50  # random ones
MOST_OVERLAPS = 4  # that are shown
WIDTH = 120  # characters of a table, at least


def inspect_robots(
    robots: Sequence[Annotated[str, Word("ROBOT", about=FORMS)]],
    *,
    picture: File | None = None,
    try_: bool = False,
) -> int:
    """Print everything about robots, or draw one, or try them in physics.

    Exit code: 0, or 1 if a robot that is tried does not work, or 2 for bad usage.

    Args:
        robots: The robots.
        picture: Save a picture of the robot (.png, .pdf, .svg): its limbs at rest, its front, its
            TCP, its gripper open and closed, what to change if something is wrong, and what was
            guessed with doubt.
        try_: Stand the robots, step them, move them and their TCPs, and close their grippers on a
            cube in physics, and print what was seen.

    Raises:
        RobotLayoutsError: If a robot does not exist, or cannot be read, drawn or built.
    """
    if picture is not None:
        if len(robots) > 1:
            raise DescriptorError(f"--picture draws one robot at a time; {len(robots)} are given")
        if is_path(robots[0]):
            guess = guessed_robot(robots[0])
            robot, doubts = guess.descriptor, guess.doubts
        else:
            robot, doubts = named_robot(robots[0]), ()
        print(f"picture: {save_picture(robot, picture, doubts)}")
    elif not try_:
        reports.inspect(robots)
    if not try_:
        return 0
    from rich.console import Console

    console = Console(markup=False, highlight=False, soft_wrap=True)
    console.width = max(console.width, WIDTH)
    problems = [_try(robot, console) for robot in [named_robot(name) for name in robots]]
    return 1 if any(problems) else 0


def _try(robot: RobotDescriptor, console: Console) -> tuple[str, ...]:
    """Try a robot, print what was seen, and return what is wrong."""
    trial, grasps = try_robot(robot, STEPS), tuple(try_grasps(robot))
    tcps, refused = list[TcpTrial](), list[str]()
    if robot.arm_joints and not trial.problems:
        try:
            tcps += try_tcp_control(robot)
        except DescriptorError as error:
            refused.append(f"TCP             is not steered: {error}")
    more = [one.problem for one in (*grasps, *tcps) if one.problem is not None]
    problems = (*trial.problems, *more)
    console.print(f"{trial.robot.name}: {trial.robot.summary}")
    for line in (*_lines(trial), *map(_grasp, grasps), *map(_tcp_control, tcps), *refused):
        console.print(f"  {line}")
    console.print(_numbers(trial))
    if not problems:
        console.print("  It stands and moves as it should.")
    for problem in problems:
        console.print(f"  WRONG: {problem}")
    console.print()
    return problems


def _lines(trial: Trial) -> Iterator[str]:
    yield f"at the start    {_overlaps(trial)}"
    joint, amount = trial.first_step
    yield f"first step      holding still, {joint} moves most: {_amount(trial, joint, amount)}"
    joint, amount = trial.after_hold
    yield f"after {HELD} steps  {joint} is fastest: {_amount(trial, joint, amount)}/s"
    yield f"random actions  {trial.steps} steps; fastest {_speed(trial, trial.fastest)}"
    yield f"TCP             {trial.robot.tcp_link}, moved by up to {trial.tcp_way * 1e3:.3g} mm"


def _grasp(seen: GraspTrial) -> str:
    if seen.fingers is None:
        return f"grasp           {seen.arm}: its fingers are not known"
    off = f"{seen.tcp_off * 1e3:.3g} mm from where {' and '.join(seen.fingers)} meet"
    holds = "grasps and holds" if seen.grasps else "does not hold"
    return f"grasp           {seen.arm}: TCP {off}; {holds} a cube of {seen.side * 1e3:.3g} mm"


def _tcp_control(seen: TcpTrial) -> str:
    lengths = seen.drift, seen.corner, seen.reported
    drift, corner, reported = (f"{length * 1e3:.2g} mm" for length in lengths)
    return (
        f"{seen.mode}  {seen.arm}: moves by {drift} while held, and misses a corner of a square by"
        f" {corner} (reported: {reported})"
    )


def _overlaps(trial: Trial) -> str:
    shown = [in_itself(overlap) for overlap in trial.overlaps[:MOST_OVERLAPS]]
    if more := len(trial.overlaps) - len(shown):
        shown.append(f"and {more} pairs of links more")
    return "; ".join(shown) or "no links are inside each other"


def _speed(trial: Trial, fastest: Fastest) -> str:
    joint, speed, limit, step = fastest
    return (
        f"{joint}: {_amount(trial, joint, speed)}/s in step {step}, {fastest.times:.2g} times"
        f" the {_amount(trial, joint, limit)}/s taken as its limit"
    )


def _amount(trial: Trial, joint: str, amount: float) -> str:
    return f"{amount:.3g} {trial.unit(joint)}"


def _numbers(trial: Trial) -> Table:
    from rich import box
    from rich.table import Table

    rows = Table(box=box.SIMPLE_HEAD)
    rows.add_column("number", no_wrap=True)
    rows.add_column("asks for", justify="right", no_wrap=True)
    rows.add_column("moves", justify="right", no_wrap=True)
    rows.add_column("of the others", no_wrap=True)
    rows.add_column("")
    for number in trial.numbers:
        rows.add_row(*_row(number))
    return rows


def _row(trial: NumberTrial) -> tuple[str, ...]:
    other = "–"
    if trial.other is not None:
        other = f"{trial.other.joint} {percent(trial.other.amount)}"
    return (
        trial.number.name,
        f"{trial.asked:.3g} {trial.number.unit.removesuffix('/s')}",
        percent(trial.least.amount),
        other,
        "WRONG" if trial.problem else "",
    )


def inspect_objects(
    objects: Sequence[Annotated[str, OBJECT]],
    *,
    seed: Seed | None = None,
    try_: bool = False,
) -> int:
    """Print everything about objects: sizes, mass, rests, points, grasps; or try them in physics.

    Exit code: 0, or 1 if an object that is tried does not stand still, or no grasp of it holds.

    Args:
        objects: The objects.
        seed: Draws a member of each object's family (default: the usual ones).
        try_: Put the objects on a table for 10 s, grasp them with hands that open 4, 7 and 10 cm,
            shake them, and print what was seen.

    Raises:
        RobotLayoutsError: If an object does not exist, or cannot be built.
    """
    things = [named_object(name, seed) for name in objects]
    problems = 0
    for thing in things:
        print(report(thing))
        for line, wrong in _tried_object(thing) if try_ else ():
            print(f"  {'WRONG: ' if wrong else ''}{line}")
            problems += wrong
    return int(problems > 0)


def _tried_object(thing: ObjectDescriptor) -> Iterator[tuple[str, bool]]:
    """Yield what is seen of a thing in physics, a line each, and whether that is wrong."""
    for seen in try_rests([thing]):
        moved = f"{seen.drift * 1e3:.2g} mm"
        yield seen.problem or f"put down {seen.rest}, it moves by {moved}", seen.problem is not None
    held = 0
    for opening in OPENINGS:
        tried = try_thing_grasps(thing, opening)
        holds = sum(grasp.holds for grasp in tried)
        held += holds
        yield f"a hand of {opening * 100:g} cm holds it in {holds} of {len(tried)} grasps", False
    if thing.grasps and not held:
        yield "no grasp holds it", True
