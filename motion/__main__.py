"""``robot-layouts motion``: plans motions, certifies, shows, draws or exports them."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from layouts.__main__ import add_layout_words, chosen_layout
from layouts.view_command import add_page_options, show
from motion.model.obstacles import Obstacle, box
from motion.motion import Motion
from motion.planning.goals import Goal, TcpGoal
from motion.planning.plan import plan
from robots.common.commands import FAILED, start
from robots.common.console import add_command, main_of
from robots.common.errors import MotionError
from robots.control_modes import read_mode

JOINTS = "joints:"

_T = TypeVar("_T")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_plan(add_command(commands, "plan", "find a motion of a layout's robots to their goals"))
    check = add_command(commands, "certify", "check a motion once more, densely and exactly")
    check.set_defaults(call=_certify)
    view = add_command(commands, "show", "show a motion in a browser, with a timeline")
    add_page_options(view)
    view.set_defaults(call=_show)
    draw = add_command(commands, "draw", "save a picture of a motion, still or moving")
    draw.set_defaults(call=_draw)
    export = add_command(commands, "export", "write a motion as tables, or for ROS 2")
    export.set_defaults(call=_export)
    for command in (check, view, draw, export):
        command.add_argument("file", metavar="FILE", help="a motion (.json)")
    draw.add_argument(
        "picture", metavar="PICTURE", help="where to save (.png, .pdf, .svg; moving: .webp, .gif)"
    )
    add = export.add_argument
    add("--csv", metavar="DIR", help="a table for each robot, NAME.csv")
    add("--ros2", metavar="DIR", help="a JointTrajectory for each controller of layouts export")
    add("--frequency", type=float, metavar="HZ", help="rows per second (those of the motion)")


def run(options: argparse.Namespace) -> int | None:
    """Run the command that is chosen; returns its exit code, None for 0.

    Raises:
        RobotLayoutsError: If it makes no sense, or fails.
    """
    return options.call(options)


def _add_plan(parser: argparse.ArgumentParser) -> None:
    add_layout_words(parser)
    add = parser.add_argument
    add(
        "--goal",
        action="append",
        default=[],
        metavar="PLACE=X,Y,Z",
        help="where a robot's or limb's tool centre point is to be (m); with four more numbers, the"
        f" wxyz orientation of its link; or {JOINTS}…, the joint positions of its arm (rad, m);"
        " may be given several times",
    )
    add(
        "--box",
        action="append",
        default=[],
        metavar="NAME=WIDTH,DEPTH,HEIGHT,X,Y,Z",
        help="a box in the way: its sizes along x, y, z and its middle (m)",
    )
    add("--after", metavar="FILE", help="begin where another motion (.json) of these robots ends")
    add(
        "--tabletop",
        type=float,
        nargs=4,
        metavar=("X_MIN", "Y_MIN", "X_MAX", "Y_MAX"),
        help="outline of a table with its top at z = 0 (m)",
    )
    add(
        "--clearance",
        type=float,
        default=0.01,
        metavar="M",
        help="distance to keep (%(default)s m)",
    )
    add(
        "--velocity",
        type=float,
        default=1.0,
        metavar="SHARE",
        help="speed, as a share of the joints' largest (%(default)s)",
    )
    add(
        "--control-mode", type=read_mode, metavar="MODE", help="control mode that will carry it out"
    )
    add("--seed", type=int, default=0, metavar="N", help="seed of the planner (%(default)s)")
    add(
        "--patience",
        type=float,
        default=30.0,
        metavar="S",
        help="time limit of the planner (%(default)s s)",
    )
    add("--out", metavar="FILE", help="save the motion (.json)")
    add("--picture", metavar="FILE", help="save a picture (.png, .pdf, .svg; moving: .webp, .gif)")
    parser.set_defaults(call=_plan)


def _plan(options: argparse.Namespace) -> None:
    motion = plan(
        chosen_layout(options),
        None if options.after is None else Motion.load(options.after).end,
        dict(_named("--goal", "left=0.4,0,0.3", options.goal, _goal)),
        obstacles=[_box(n, sizes) for n, sizes in _named("--box", BOX, options.box, _numbers)],
        table=None if options.tabletop is None else tuple(options.tabletop),
        clearance=options.clearance,
        seed=options.seed,
        patience=options.patience,
        control_mode=options.control_mode,
        velocity=options.velocity,
    )
    print(f"{motion.duration:.2f} s: {', '.join(motion.moving) or 'nothing'} moved")
    if options.out is not None:
        print(f"motion: {motion.save(options.out)}")
    if options.picture is not None:
        print(f"picture: {motion.picture(options.picture)}")


def _certify(options: argparse.Namespace) -> int:
    certificate = Motion.load(options.file).certify()
    print(certificate)
    return 0 if certificate.ok else FAILED


def _show(options: argparse.Namespace) -> int:
    from motion.output.page import motion_cell

    motion = Motion.load(options.file)
    return show(lambda: motion_cell(motion, options.file), options)


def _draw(options: argparse.Namespace) -> None:
    print(f"picture: {Motion.load(options.file).picture(options.picture)}")


def _export(options: argparse.Namespace) -> None:
    motion = Motion.load(options.file)
    if options.csv is None and options.ros2 is None:
        raise MotionError("nothing is to be written; give --csv DIR, --ros2 DIR or both")
    if options.csv is not None:
        for path in motion.to_csv(options.csv, frequency=options.frequency):
            print(f"table: {path}")
    if options.ros2 is not None:
        for path in motion.to_ros2(options.ros2, frequency=options.frequency):
            print(f"trajectory: {path}")


BOX = "wall=0.1,1,0.5,0.4,0,0.25"


def _named(
    option: str, example: str, words: Sequence[str], read: Callable[[str, str], _T]
) -> Iterator[tuple[str, _T]]:
    """Yield names and what is said of them, out of words ``name=…``.

    Raises:
        MotionError: If a word does not have that form, or a name is given twice.
    """
    seen: set[str] = set()
    for word in words:
        name, equals, value = word.partition("=")
        if not (name and equals):
            raise MotionError(f"{option} {word!r} lacks a name; for example {option} {example}")
        if name in seen:
            raise MotionError(f"{option} {name!r} is given twice")
        seen.add(name)
        yield name, read(f"{option} {word!r}", value)


def _goal(word: str, value: str) -> Goal:
    if value.startswith(JOINTS):
        return _numbers(word, value.removeprefix(JOINTS))
    numbers = _numbers(word, value)
    if len(numbers) not in (3, 7):
        raise MotionError(
            f"{word} has {len(numbers)} numbers; x, y, z (m), or these and the wxyz orientation,"
            f" or {JOINTS} and all joints of the arm"
        )
    return TcpGoal(numbers[:3], numbers[3:] or None)


def _box(name: str, numbers: Sequence[float]) -> Obstacle:
    if len(numbers) != 6:
        raise MotionError(f"--box {name!r} has {len(numbers)} numbers; for example --box {BOX}")
    return box(name, numbers[:3], numbers[3:])


def _numbers(word: str, value: str) -> list[float]:
    try:
        return [float(number) for number in value.split(",")]
    except ValueError:
        raise MotionError(f"{word} should be numbers with commas between them") from None


main = main_of("motion")

if __name__ == "__main__":
    start(main)
