"""The page of a robot: what moves, what drives it, and where its files come from."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from measurements.gallery.markdown import (
    BACK,
    WIDE,
    code,
    facts,
    picture,
    portrait_path,
    quoted,
    section,
    table,
    task_path,
)
from measurements.gallery.record import Joint
from measurements.gallery.sources import (
    Sources,
    can_be_drawn,
    files_of,
    is_optional,
    summary,
    task_classes,
)
from robots import RobotDescriptor, RobotLayoutsError
from robots.assets.progress import size

UP = "../"  # from a page to the gallery's folder


def robot_page(robot: RobotDescriptor, sources: Sources) -> Iterator[str]:
    """Yield the lines of a robot's page.

    Raises:
        GalleryError: If nothing was read of its files.
    """
    yield from WIDE
    yield f"# {robot.name}"
    yield ""
    yield summary(robot.name)
    yield ""
    yield from _portrait(robot, sources)
    yield from facts(_facts(robot))
    yield ""
    yield from section("Use it", _python(robot), _console(robot))
    yield from section("Joints", _joints(robot, sources.record.robot(robot.name).joints))
    yield from section("Action numbers", *_numbers(robot))
    yield from section("Control modes", *_modes(robot))
    yield from section("Limbs", *_limbs(robot))
    yield from section("Keyframes", _keyframes(robot))
    yield from section("Cameras", _cameras(robot))
    yield from section("Files and licence", *_files(robot))
    yield BACK


def _portrait(robot: RobotDescriptor, sources: Sources) -> Iterator[str]:
    path = portrait_path(robot.name)
    if path in sources.pictures:
        what = "Picture" if can_be_drawn(robot) else "Collision shapes"
        yield picture(f"{UP}{path}", f"{what} of {robot.name} in its home posture")
        yield ""


def _facts(robot: RobotDescriptor) -> Iterator[tuple[str, str]]:
    origin = files_of(robot)[0].origin
    held = sum(len(group.joints) for group in robot.action_split.groups.values() if group.held)
    yield "Joints", f"{robot.dof}{f', {held} of them held still' if held else ''}"
    yield "Action", f"{robot.action_dim} numbers"
    yield "Reach", f"{robot.reach:g} m from the base axis"
    yield "Tool centre point", _tcp(robot)
    yield "Limbs", quoted(robot.limbs)
    yield "Grasps with", quoted(_fingers(robot))
    yield "Cameras", quoted(camera.name for camera in robot.cameras)
    yield "Licence of its files", origin.licence
    yield "Files from", origin.wheel.replace("==", " ")
    yield "Numbers from", robot.source
    yield "Default robot of", _tasks(robot)


def _tcp(robot: RobotDescriptor) -> str:
    links = quoted(robot.tcp_position_links)
    place = f"the middle of {links}, turned as `{robot.tcp_link}`" if links else ""
    offset = ", ".join(f"{x:g}" for x in robot.tcp_offset) if any(robot.tcp_offset) else ""
    return f"{place or f'`{robot.tcp_link}`'}{f', ({offset}) m from it' if offset else ''}"


def _fingers(robot: RobotDescriptor) -> list[str]:
    own = [robot.fingers, *(limb.fingers for limb in robot.limbs.values())]
    return list(dict.fromkeys(link for fingers in own if fingers for link in fingers.links))


def _tasks(robot: RobotDescriptor) -> str:
    ids = [
        task_id
        for task_id, cls in task_classes().items()
        if any(placement.robot.name == robot.name for placement in cls.layout.values())
    ]
    return ", ".join(f"[{task_id}]({UP}{task_path(task_id)})" for task_id in ids)


def _python(robot: RobotDescriptor) -> Iterator[str]:
    yield from code(
        "python",
        f"""
from robots import RobotRegistry

robot = RobotRegistry.load("{robot.name}")  # touches no file
for number in robot.describe_action():
    print(number)
""",
    )


def _console(robot: RobotDescriptor) -> Iterator[str]:
    install = "$ pip install 'robot-layouts[robots]'  # its files\n" if is_optional(robot) else ""
    yield from code(
        "console",
        f"""
{install}$ robot-layouts robots fetch {robot.name}
$ robot-layouts robots inspect {robot.name} --try    # stand it, step it, move each number
""",
    )


def _joints(robot: RobotDescriptor, joints: Sequence[Joint]) -> Iterator[str]:
    groups = {
        joint: f"`{name}`{', held' if group.held else ''}"
        for name, group in robot.action_split.groups.items()
        for joint in group.joints
    }
    rows = (
        (
            f"`{joint.name}`",
            _limits(joint),
            _with_unit(joint.velocity, f"{joint.unit}/s"),
            _with_unit(joint.effort, "N" if joint.unit == "m" else "N·m"),
            groups.get(joint.name, "nothing")
            + (f"; mimics `{joint.mimics}`" if joint.mimics else ""),
        )
        for joint in joints
    )
    yield from table(("joint", "limits", "speed", "effort", "driven by"), rows, numbers=(2, 3))


def _limits(joint: Joint) -> str:
    if joint.lower is None or joint.upper is None:
        return f"none ({joint.unit})"
    return f"{joint.lower:.4g} … {joint.upper:.4g} {joint.unit}"


def _with_unit(value: float | None, unit: str) -> str:
    if value is None:
        return "–"
    return f"{value:,.0f} {unit}" if value >= 1e4 else f"{value:.4g} {unit}"


def _numbers(robot: RobotDescriptor) -> Iterator[Iterable[str]]:
    yield ["In the default control mode, `pd_joint_delta_pos`, each from -1 to 1:"]
    rows = (
        (
            str(number.index),
            f"`{number.name}`",
            f"{number.lower:{'+' if number.relative else ''}.4g}",
            f"{number.upper:{'+' if number.relative else ''}.4g}",
            number.unit,
        )
        for number in robot.describe_action()
    )
    yield table(("#", "number", "lowest", "highest", "unit"), rows, numbers=(0, 2, 3))


def _modes(robot: RobotDescriptor) -> Iterator[Iterable[str]]:
    rows: list[tuple[str, str, str]] = []
    reasons: dict[str, list[str]] = {}
    for mode in robot.modes:
        try:
            numbers = robot.in_control_mode(mode).describe_action()
        except RobotLayoutsError as error:
            reason = str(error).partition(". ")[0].removeprefix(f"{robot.name}: ")
            reasons.setdefault(reason.replace(repr(mode), "each"), []).append(mode)
        else:
            units = Counter(number.unit for number in numbers)
            what = " + ".join(f"{count} × {unit}" for unit, count in units.items())
            rows.append((f"`{mode}`", str(len(numbers)), what))
    yield table(("control mode", "numbers", "what they are"), rows, numbers=(1,))
    yield (f"Not offered: {quoted(modes)}; {reason}." for reason, modes in reasons.items())


def _limbs(robot: RobotDescriptor) -> Iterator[Iterable[str]]:
    if not robot.limbs:
        return
    rows = (
        (
            f"`{name}`",
            f"`{robot.name}.{name}`",
            quoted(part.action_split.groups),
            str(part.action_dim),
            _tcp(part),
            f"{part.reach:g}",
        )
        for name, part in robot.parts.items()
    )
    headings = ("part", "as a place", "joint groups", "numbers", "tool centre point", "reach (m)")
    yield table(headings, rows, numbers=(3, 5))
    yield ["Tasks take limbs as robots: a task of two arms is played by one robot that has two."]


def _keyframes(robot: RobotDescriptor) -> Iterator[str]:
    rows = (
        (f"`{name}`{' (home)' if name == robot.home.keyframe else ''}", _row(qpos))
        for name, qpos in robot.keyframes.items()
    )
    yield from table(("keyframe", "joint positions (rad, m)"), rows)


def _row(values: Iterable[float]) -> str:
    return ", ".join(f"{round(value, 6) + 0.0:.4g}" for value in values)


def _cameras(robot: RobotDescriptor) -> Iterator[str]:
    rows = [
        (f"`{c.name}`", f"`{c.link}`", f"{c.width} × {c.height}", f"{c.fov:.3g}")
        for c in robot.cameras
    ]
    if rows:
        yield from table(("camera", "link", "pixels", "field of view (rad)"), rows, numbers=(3,))


def _files(robot: RobotDescriptor) -> Iterator[Iterable[str]]:
    package, urdf = files_of(robot)
    origin = package.origin
    physics = package.needed(urdf, pictures=False)
    pictures = [f for f in package.needed(urdf, pictures=True) if f not in physics]
    hub = f"`{origin.hub_folder}` of the Hugging Face dataset `{origin.hub_dataset}`"
    rows = [
        ("Licence", origin.licence_note),
        ("Package", origin.wheel.replace("==", " ")),
        ("Folder", f"`{origin.folder}`"),
        ("URDF", f"`{urdf}`"),
        ("Also in", hub if origin.hub_dataset else ""),
        ("For physics", _amount([file.bytes for file in physics])),
        ("For pictures", _amount([file.bytes for file in pictures])),
    ]
    yield facts(rows)
    yield [
        "The files are not part of this library: they are fetched, and checked by their SHA-256."
    ]
    if not can_be_drawn(robot):
        yield [
            f"{origin.distribution} lacks some of its visual meshes, so that no camera sees it;"
            " physics needs none. The picture shows its collision shapes."
        ]


def _amount(sizes: Sequence[int]) -> str:
    return f"{len(sizes)} files, {size(sum(sizes))}" if sizes else ""
