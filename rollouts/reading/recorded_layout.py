"""Makes a layout of what a recording or a receipt says of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from layouts import Layout, Placement
from layouts.placement import RobotLike
from robots import LayoutError, RobotLayoutsError, RobotRegistry, UnknownNameError
from rollouts.reading.guessed_robots import guess_again
from rollouts.reading.trajectory import TrajectoryError

MOST_ROBOTS = 64  # each takes memory, whoever wrote the file


def layout_again(
    described: Mapping[str, Mapping[str, Any]],
    guessed: Mapping[str, Mapping[str, str]],
    own: Layout,
    robots: Mapping[str, RobotLike],
    source: object,
) -> Layout:
    """Return a layout that `rollouts.reading.provenance.describe_layout` described.

    Args:
        described: The description; ``control_mode`` of a place counts where it is there.
        guessed: Robots that were guessed from a URDF or MJCF; see `guess_again`.
        own: The layout that the task declares: its robots are taken where their names fit.
        robots: Which robots to take, by place, where the description cannot say it.
        source: The file, for errors.

    Raises:
        UnknownNameError: If a robot is given for a place that there is not.
        TrajectoryError: If a robot cannot be had here, or it is no layout.
    """
    for place in robots:
        if place not in described:
            raise UnknownNameError("place", place, described)
    if len(described) > MOST_ROBOTS:
        raise TrajectoryError(
            f"{source} has a layout of {len(described)} robots; {MOST_ROBOTS} are the most that"
            " are built for a recording"
        )
    placements: dict[str, Placement] = {}
    for place, about in described.items():
        try:
            if place in robots:
                robot: RobotLike = robots[place]
            elif place in guessed:
                robot = guess_again(place, guessed[place], about["robot"])
            elif place in own and own[place].robot.name == about["robot"]:
                robot = own[place].robot
            else:
                robot = RobotRegistry.load(about["robot"])
            placements[place] = Placement(
                robot,
                tuple(about["position"]),  # pyright: ignore[reportArgumentType]
                tuple(about["quaternion"]),  # pyright: ignore[reportArgumentType]
                about["keyframe"],
                about["qpos_noise"],
                control_mode=about.get("control_mode"),
            )
        except TrajectoryError:
            raise
        except RobotLayoutsError as error:
            raise TrajectoryError(
                f"{source} has a robot at {place!r} that cannot be had here:"
                f" {str(error).rstrip('.')}; name the robot, with --robots {place}=… or"
                f" robots={{{place!r}: …}}"
            ) from error
    try:
        return Layout(placements)
    except LayoutError as error:
        raise TrajectoryError(f"{source} has no layout that can be used: {error}") from error


def same_places(first: Layout, second: Layout) -> bool:
    """Return whether two layouts put the same robots at the same places of the world."""
    return [_outline(*item) for item in first.items()] == [
        _outline(*item) for item in second.items()
    ]


def _outline(place: str, placement: Placement) -> tuple[Any, ...]:
    pose = placement.base_pose
    start = placement.start_keyframe, placement.qpos_noise
    return place, placement.robot, pose.position, pose.quaternion, *start
