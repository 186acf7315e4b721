"""Makes the task and the layout of what a recording or a receipt says of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from layouts import Frame, Layout, Placement
from layouts.placement import RobotLike
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.provenance import guess_again
from robot_layouts.data.reading.recording import Recording
from robots import LayoutError, RobotLayoutsError, RobotRegistry, UnknownNameError
from tasks import MultiRobotTask, TaskEnv, get_task_class, make
from tasks.engine.cameras import cameras_again
from tasks.language.fitting import TASK
from tasks.language.needs import ACT, HOLD
from tasks.native.format import mode_by_arm
from tasks.randomization.declaration import Randomization

MOST_ROBOTS = 64  # each takes memory, and a file may come from anyone


def task_class(file: Recording, task_id: str | None = None) -> type[MultiRobotTask]:
    """Return the class of the task that a file was recorded in.

    Args:
        file: The recording.
        task_id: Which task it must be; ``module:Id`` imports a module of the user's own, which a
            recording does not do by itself: it must not choose which code runs.

    Raises:
        UnknownNameError: If there is no such task.
        TrajectoryError: If it is of another task, or its module has to be named.
    """
    wanted = None if task_id is None else get_task_class(task_id)
    try:
        recorded = get_task_class(file.task_id)
    except UnknownNameError as error:
        if file.module is None or wanted is not None:
            raise
        raise TrajectoryError(
            f"{file.path} was recorded in {file.task_id} of the module {file.module}, which no"
            " installed package lists, and a recording does not choose which code runs; name it:"
            f" --task {file.module}:{file.task_id}, or import the module"
        ) from error
    if wanted is not None and recorded is not wanted:
        raise TrajectoryError(
            f"{file.path} was recorded in {file.task_id}, not in {wanted.task_id}"
        )
    return recorded


def task_for(
    file: Recording,
    *,
    layout: Layout | None = None,
    robots: RobotLike | Mapping[str, RobotLike] | None = None,
    bystanders: str | None = None,
    pictures: bool = False,
    **observing: Any,
) -> TaskEnv:
    """Make the task that a file was recorded in, with its robots where they stood.

    It has the cameras and meshes with which the file's observations were drawn, if it holds any.

    Args:
        file: The recording.
        layout: Where they stood, where the file cannot say it; the same is needed.
        robots: Which robots these were, where the file cannot say it; the same are needed.
        bystanders: What those without a place did, where the file cannot say it.
        pictures: Whether to draw its worlds.
        observing: What it observes, and with what that is drawn, as arguments of `tasks.make`;
            nothing if ``obs_mode`` is not among them.

    Raises:
        UnknownNameError: If there is no such task.
        TrajectoryError: If the file's layout, robot files, physics or actions are not those of
            the task that can be made here.
        TaskError: If the task cannot be made like that.
        AssetError: If robot files cannot be found.
    """
    cls = task_class(file)
    making: dict[str, Any] = {"layout": layout, "robots": robots, "bystanders": bystanders}
    if layout is None and file.layout is not None:
        named = robots if isinstance(robots, Mapping) else dict.fromkeys(file.layout, robots)
        making |= _recorded(file, cls, {n: r for n, r in named.items() if r is not None})
    if "control_frequency" in (file.simulation or {}):
        making["control_frequency"] = file.simulation["control_frequency"]
    making["randomization"] = _varied(file)
    making["simulator"] = file.simulator
    making |= {"obs_mode": "none", **_drawn_with(file), **observing}
    task = make(
        file.task_id,
        control_mode=mode_by_arm(file.control_mode, making["layout"] or cls.layout),
        render_mode="rgb_array" if pictures else None,
        **making,
    )
    file.expect(task.task_id, task.layout.action_dim)
    file.expect_world(task)
    return task


def _varied(file: Recording) -> Randomization | None:
    """Return what varied in the worlds of a recording."""
    described = (file.simulation or {}).get("randomization")
    try:
        return None if described is None else Randomization.from_json(described)
    except RobotLayoutsError as error:
        raise TrajectoryError(
            f"{file.path} has a randomization that is invalid here: {error}"
        ) from error


def _drawn_with(file: Recording) -> dict[str, Any]:
    """Return with what the observations of a recording were drawn, as arguments of `tasks.make`."""
    try:
        return cameras_again(file.pictures or {})
    except RobotLayoutsError as error:
        raise TrajectoryError(f"{file.path} has cameras that are invalid here: {error}") from error


def _recorded(
    file: Recording, cls: type[MultiRobotTask], robots: Mapping[str, RobotLike]
) -> dict[str, Any]:
    """Return the layout of a recording as arguments of `tasks.make`, none if it is the task's."""
    layout = layout_again(file.layout or {}, file.guessed or {}, cls.layout, robots, file.path)
    if same_places(layout, cls.layout):
        return {"robots": None}
    extra = cls.robot_counts is None and set(layout.places) - set(cls.layout.places)
    bystanders = (HOLD if _holds(file, layout) else ACT) if extra else None
    return {"layout": layout, "robots": None, "bystanders": bystanders, "check_layout": False}


def _holds(file: Recording, layout: Layout) -> bool:
    """Return whether robots or limbs of a recording took fewer numbers than they can."""
    acting = layout.in_control_mode(mode_by_arm(file.control_mode, layout)).robot_actions
    recorded = {place: about["action"] for place, about in (file.layout or {}).items()}
    return any(
        last - first < acting[place].stop - acting[place].start
        for place, (first, last) in recorded.items()
    )


def layout_again(
    described: Mapping[str, Mapping[str, Any]],
    guessed: Mapping[str, Mapping[str, str]],
    own: Layout,
    robots: Mapping[str, RobotLike],
    source: object,
) -> Layout:
    """Return a layout that `robot_layouts.data.reading.provenance.describe_layout` described.

    Args:
        described: The description; ``control_mode`` of a place counts where it is there.
        guessed: Robots that were guessed from a URDF or MJCF; see `guess_again`.
        own: The layout that the task declares: its robots are taken where their names fit.
        robots: Which robots to take, by place, where the description cannot say it.
        source: The file, for errors.

    Raises:
        UnknownNameError: If a robot is given for a place that does not exist.
        TrajectoryError: If a robot is not available here, or it is no layout.
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
                qpos=None if about["keyframe"] else about.get("start_qpos"),
            )
        except TrajectoryError:
            raise
        except RobotLayoutsError as error:
            raise TrajectoryError(
                f"{source} has a robot at {place!r} that is not available here:"
                f" {str(error).rstrip('.')}; name the robot, with --robots {place}=… or"
                f" robots={{{place!r}: …}}"
            ) from error
    try:
        lies = next((about["task"] for about in described.values() if "task" in about), None)
        frames = {} if lies is None else {TASK: Frame(tuple(lies[:3]), tuple(lies[3:]))}
        return Layout(placements, frames)
    except LayoutError as error:
        raise TrajectoryError(f"{source} has no layout that can be used: {error}") from error


def same_places(first: Layout, second: Layout) -> bool:
    """Return whether two layouts put the same robots and the task at the same places."""
    if first.frame_poses.get(TASK) != second.frame_poses.get(TASK):
        return False
    return [_outline(*item) for item in first.items()] == [
        _outline(*item) for item in second.items()
    ]


def _outline(place: str, placement: Placement) -> tuple[Any, ...]:
    pose = placement.base_pose
    start = placement.start_keyframe, placement.qpos, placement.qpos_noise
    return place, placement.robot, pose.position, pose.quaternion, *start
