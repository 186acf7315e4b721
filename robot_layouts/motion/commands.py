"""``robot-layouts motion``: plans motions, certifies, shows, draws or exports them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from layouts.commands import LayoutWords, Page
from robot_layouts.core.cli import Corners, File, Word, by_name
from robot_layouts.core.commands import FAILED
from robot_layouts.core.errors import MotionError
from robot_layouts.motion.model.obstacles import Obstacle, box
from robot_layouts.motion.motion import Motion
from robot_layouts.motion.planning import plan as planning
from robot_layouts.motion.planning.goals import Goal, TcpGoal
from robots.control_modes import read_mode

JOINTS = "joints:"


def plan(
    layout: LayoutWords,
    *,
    goal: Annotated[Sequence[str], Word("PLACE=X,Y,Z", action="append")] = (),
    box: Annotated[Sequence[str], Word("NAME=WIDTH,DEPTH,HEIGHT,X,Y,Z", action="append")] = (),
    after: File | None = None,
    tabletop: Corners | None = None,
    clearance: Annotated[float, Word("M")] = 0.01,
    velocity: Annotated[float, Word("SHARE")] = 1.0,
    control_mode: Annotated[str | dict[str, str], Word("MODE", read_mode)] | None = None,
    seed: int = 0,
    patience: Annotated[float, Word("S")] = 30.0,
    out: File | None = None,
    picture: File | None = None,
) -> None:
    """Find a motion of a layout's robots to their goals.

    Args:
        layout: The layout.
        goal: Where a robot's or limb's tool centre point is to be (m); with four more numbers, the
            wxyz orientation of its link; or joints:…, the joint positions of its arm (rad, m); may
            be given several times.
        box: A box in the way: its sizes along x, y, z and its middle (m).
        after: Begin where another motion (.json) of these robots ends.
        tabletop: Outline of a table with its top at z = 0 (m).
        clearance: Distance to keep (m).
        velocity: Speed, as a share of the joints' largest.
        control_mode: Control mode that will carry it out.
        seed: Seed of the planner.
        patience: Time limit of the planner (s).
        out: Save the motion (.json).
        picture: Save a picture (.png, .pdf, .svg; moving: .webp, .gif).

    Raises:
        RobotLayoutsError: If an option is invalid, or no motion is found.
    """
    motion = planning.plan(
        layout.layout(),
        None if after is None else Motion.load(after).end,
        _goals(goal),
        obstacles=_boxes(box),
        table=tabletop,
        clearance=clearance,
        seed=seed,
        patience=patience,
        control_mode=control_mode,
        velocity=velocity,
    )
    print(f"{motion.duration:.2f} s: {', '.join(motion.moving) or 'nothing'} moved")
    if out is not None:
        print(f"motion: {motion.save(out)}")
    if picture is not None:
        print(f"picture: {motion.picture(picture)}")


def certify(file: str) -> int:
    """Check a motion once more, densely and exactly.

    Args:
        file: A motion (.json).

    Raises:
        RobotLayoutsError: If it cannot be read.
    """
    certificate = Motion.load(file).certify()
    print(certificate)
    return 0 if certificate.ok else FAILED


def show(file: str, *, page: Page) -> None:
    """Look at a motion in a browser, with a timeline.

    Args:
        file: A motion (.json).
        page: Where it is served or saved.

    Raises:
        RobotLayoutsError: If it cannot be read, served or saved.
    """
    from robot_layouts.motion.output.scenes import motion_cell

    motion = Motion.load(file)
    page.show(lambda: motion_cell(motion, file))


def draw(file: str, picture: str) -> None:
    """Save a picture of a motion, still or moving.

    Args:
        file: A motion (.json).
        picture: Where to save (.png, .pdf, .svg; moving: .webp, .gif).

    Raises:
        RobotLayoutsError: If it cannot be read or drawn.
    """
    print(f"picture: {Motion.load(file).picture(picture)}")


def export(
    file: str,
    *,
    csv: Annotated[str, Word("DIR")] | None = None,
    ros2: Annotated[str, Word("DIR")] | None = None,
    frequency: Annotated[float, Word("HZ")] | None = None,
) -> None:
    """Write a motion as tables, or for ROS 2.

    Args:
        file: A motion (.json).
        csv: A table for each robot, NAME.csv.
        ros2: A JointTrajectory for each controller of layouts export.
        frequency: Rows per second (those of the motion).

    Raises:
        RobotLayoutsError: If it cannot be read or written.
    """
    motion = Motion.load(file)
    if csv is None and ros2 is None:
        raise MotionError("nothing is to be written; give --csv DIR, --ros2 DIR or both")
    if csv is not None:
        for path in motion.to_csv(csv, frequency=frequency):
            print(f"table: {path}")
    if ros2 is not None:
        for path in motion.to_ros2(ros2, frequency=frequency):
            print(f"trajectory: {path}")


def _goals(words: Sequence[str]) -> dict[str, Goal]:
    goals = by_name(words, "PLACE=X,Y,Z", "left=0.4,0,0.3", MotionError, "--goal")
    return {place: _goal(f"--goal '{place}={text}'", text) for place, text in goals.items()}


def _goal(word: str, text: str) -> Goal:
    if text.startswith(JOINTS):
        return _numbers(word, text.removeprefix(JOINTS))
    numbers = _numbers(word, text)
    if len(numbers) not in (3, 7):
        raise MotionError(
            f"{word} has {len(numbers)} numbers; x, y, z (m), or these and the wxyz orientation,"
            f" or {JOINTS} and all joints of the arm"
        )
    return TcpGoal(numbers[:3], numbers[3:] or None)


def _boxes(words: Sequence[str]) -> list[Obstacle]:
    form = "NAME=WIDTH,DEPTH,HEIGHT,X,Y,Z"
    boxes = by_name(words, form, "wall=0.1,1,0.5,0.4,0,0.25", MotionError, "--box")
    found: list[Obstacle] = []
    for name, text in boxes.items():
        numbers = _numbers(f"--box '{name}={text}'", text)
        if len(numbers) != 6:
            raise MotionError(f"--box {name!r} has {len(numbers)} numbers; it takes {form}")
        found.append(box(name, numbers[:3], numbers[3:]))
    return found


def _numbers(word: str, value: str) -> list[float]:
    try:
        return [float(number) for number in value.split(",")]
    except ValueError:
        raise MotionError(f"{word} should be numbers with commas between them") from None
