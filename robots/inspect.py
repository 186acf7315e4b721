"""``robot-layouts robots inspect`` and ``robots list``: what there is to know about robots."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from robot_layouts.core.commands import print_error
from robot_layouts.core.paths import default_root
from robot_layouts.core.quoting import columns
from robots.assets.locator import LocalUrdf, UrdfLocator
from robots.assets.manifest import AssetFile, AssetPackage, SourceError, find_package, load_manifest
from robots.assets.store import AssetStore, FileState, size
from robots.descriptor import JointGroup, RobotDescriptor
from robots.fetch_assets import describe_file
from robots.mjcf.locator import LocalMjcf
from robots.named import named_robot
from robots.registry import RobotRegistry
from robots.urdf.model import ModelJoint
from robots.urdf.reading import model_of
from robots.urdf.summary import read_cleaned
from robots.urdf.tcp import find_tcp
from robots.urdf.tree import kinematic_tree


def inspect(robots: Sequence[str]) -> None:
    """Print everything about robots: joints, action numbers, gripper, cameras and files.

    Fetches nothing.

    Args:
        robots: The robots, as `named_robot` takes them.

    Raises:
        RobotLayoutsError: If a robot does not exist, or its files cannot be read.
    """
    for robot in map(named_robot, robots):
        print(report(robot, AssetStore(default_root())))


def list_robots() -> int:
    """List the robots: joints, action numbers, reach, source of the numbers.

    Exit code: 0, or 1 if a robot of another package cannot be loaded.
    """
    robots, failures = RobotRegistry.load_all()
    rows = [("robot", "joints", "action", "reach (m)", "numbers from")]
    rows += [(r.name, str(r.dof), str(r.action_dim), f"{r.reach:g}", r.source) for r in robots]
    print("\n".join(columns(rows)))
    for failure in failures:
        print_error(failure)
    return 1 if failures else 0


def report(robot: RobotDescriptor, store: AssetStore) -> str:
    """Return everything there is to know about a robot, as text.

    Args:
        robot: The robot.
        store: The local copy of robot files to look into.
    """
    urdf, remark = find_urdf(robot, store)
    sections: dict[str, Iterable[str]] = {
        f"{robot.name}: {robot.summary}": [
            f"numbers from  {robot.source}",
            f"reach         {robot.reach:g} m from the base axis",
            f"TCP           {_tcp(robot)}",
            *(
                f"limb          {name}: TCP {limb.tcp_link}, reach {limb.reach:g} m from"
                f" ({_row(limb.base)}) m"
                for name, limb in robot.limbs.items()
            ),
            f"home          position {_row(robot.home.position)} m, quaternion wxyz"
            f" {_row(robot.home.quaternion)}, keyframe {robot.home.keyframe!r}",
            f"URDF          {remark}",
        ],
        **_repairs(urdf),
        "Joints that move": _joints(robot, urdf),
        "Action, each number from -1 to 1": map(str, robot.describe_action()),
        "Drives": _drives(robot),
        "Keyframes (rad, m)": _keyframes(robot, urdf),
        "Gripper": _gripper(robot),
        "Links that may overlap": _overlaps(robot),
        "Links that do not touch floors": robot.no_floor_contact or ["none"],
        "Cameras": _cameras(robot),
        "Files": _files(robot, store),
    }
    lines: list[str] = []
    for title, body in sections.items():
        lines += [title, *(f"  {line}" for line in body), ""]
    return "\n".join(lines)


def _repairs(urdf: Path | None) -> dict[str, tuple[str, ...]]:
    """Return a section on what is repaired in a URDF, or none if nothing is."""
    repairs = read_cleaned(urdf).repairs if urdf is not None else ()
    return {"Repaired in the URDF": repairs} if repairs else {}


def find_urdf(robot: RobotDescriptor, store: AssetStore) -> tuple[Path | None, str]:
    """Return where the robot's URDF can be read now, fetching nothing, and a remark on it."""
    urdf = robot.urdf
    if isinstance(urdf, LocalUrdf):
        path = urdf.locate()
        return path, str(path)
    if isinstance(urdf, LocalMjcf):
        path = urdf.locate()
        return path, f"{path}, made of {urdf.path}"
    if not isinstance(urdf, UrdfLocator):
        return None, f"{urdf!r}: unknown kind of locator, not read"
    package = load_manifest().package(urdf.package)
    file = next(
        file for file in package.needed(urdf.file, pictures=False) if file.path == urdf.file
    )
    if store.state(file) is FileState.VERIFIED:
        return store.path(file), f"{store.path(file)} ({FileState.VERIFIED.value})"
    try:
        path = find_package(package.origin.distribution) / package.origin.folder / urdf.file
    except SourceError:
        return None, f"{store.path(file)} is {store.state(file).value}; {_fetch_hint(robot)}"
    where = f"installed {package.origin.distribution}; not in {store.root} yet"
    return path, f"{path} ({where}: {_fetch_hint(robot)})"


def _fetch_hint(robot: RobotDescriptor) -> str:
    return f"`robot-layouts robots fetch {robot.name}` fetches it"


def _joints(robot: RobotDescriptor, urdf: Path | None) -> Iterable[str]:
    if urdf is None:
        return ["not known without the URDF"]
    groups = {
        joint: name for name, group in robot.action_split.groups.items() for joint in group.joints
    }
    rows = [("joint", "type", "limits", "effort", "speed", "driven by")]
    for joint in model_of(urdf).moving:
        driven = groups.get(joint.name, "nothing")
        mimics = f" (URDF: mimics {joint.mimics})" if joint.mimics else ""
        rows.append((joint.name, joint.type, _limits(joint), *_bounds(joint), driven + mimics))
    return columns(rows)


def _limits(joint: ModelJoint) -> str:
    if joint.lower is None or joint.upper is None:
        return "none"
    return f"{joint.lower:g} … {joint.upper:g} {joint.unit}"


def _bounds(joint: ModelJoint) -> tuple[str, str]:
    force = "N" if joint.unit == "m" else "N·m"
    return (
        "none" if joint.effort is None else f"{joint.effort:g} {force}",
        "none" if joint.velocity is None else f"{joint.velocity:g} {joint.unit}/s",
    )


def _drives(robot: RobotDescriptor) -> Iterable[str]:
    rows = [("group", "joints", "stiffness", "damping", "force limit", "friction", "armature")]
    for name, group in robot.action_split.groups.items():
        force, per = ("N", "N/m") if group.unit == "m" else ("N·m", "N·m/rad")
        rows.append(
            (
                name,
                str(len(group.joints)) + _how_driven(group),
                f"{_numbers(group.stiffness)} {per}",
                f"{_numbers(group.damping)} {per.replace('/', '·s/')}",
                f"{_numbers(group.force_limit)} {force}",
                f"{group.friction:g}",
                f"{_numbers(group.armature)} {'kg' if group.unit == 'm' else 'kg·m²'}",
            )
        )
    return columns(rows)


def _how_driven(group: JointGroup) -> str:
    if group.held:
        return " held still"
    if group.leaders:
        return f" on one number, led by {' and '.join(group.leaders)}"
    return " on one number" if group.mimic else ""


def _numbers(value: float | tuple[float, ...]) -> str:
    return "/".join(f"{number:g}" for number in (value if isinstance(value, tuple) else (value,)))


def _keyframes(robot: RobotDescriptor, urdf: Path | None) -> Iterator[str]:
    places = _tcp_places(robot, urdf) if urdf is not None else {}
    for name, qpos in robot.keyframes.items():
        place = f"; TCP at {_row(places[name])} m from the base" if name in places else ""
        yield f"{name}: {_row(qpos)}{place}"


def _tcp_places(robot: RobotDescriptor, urdf: Path) -> dict[str, Sequence[float]]:
    """Return where the TCP is at each keyframe, in the base frame (m)."""
    model = model_of(urdf)
    others = [joint.name for joint in model.moving if joint.name not in robot.joints]
    tree = kinematic_tree(model, [*robot.joints, *others])
    qpos = np.zeros((len(robot.keyframes), len(tree.coordinates)))
    qpos[:, : robot.dof] = list(robot.keyframes.values())
    places = find_tcp(robot, tree).places(tree.forward(qpos))
    return dict(zip(robot.keyframes, places.tolist(), strict=True))


def _tcp(robot: RobotDescriptor) -> str:
    links = robot.tcp_position_links
    text = f"the middle of {', '.join(links)}, turned as {robot.tcp_link}" if links else ""
    offset = f", {_row(robot.tcp_offset)} m from it" if any(robot.tcp_offset) else ""
    return f"{text or robot.tcp_link}{offset}"


def _gripper(robot: RobotDescriptor) -> Iterator[str]:
    if robot.gripper_material is None and robot.fingers is None:
        yield "none"
    if (material := robot.gripper_material) is not None:
        yield (
            f"material of {', '.join(material.links)}:"
            f" static friction {material.static_friction:g}, dynamic {material.dynamic_friction:g},"
            f" restitution {material.restitution:g},"
            f" patch radius {material.patch_radius:g} m"
        )
    if (fingers := robot.fingers) is not None:
        yield (
            f"grasps while {' and '.join(fingers.links)} each feel {fingers.min_force:g} N or more,"
            f" within {fingers.max_angle:g}° of the direction they open in"
        )


def _overlaps(robot: RobotDescriptor) -> Iterator[str]:
    if robot.allowed_collisions is None:
        yield "the SRDF's pairs of reason Default, and those that a joint joins"
        return
    yield "those that a joint joins or that are rigid with each other"
    for one, other in robot.allowed_collisions:
        yield f"{one} and {other}"


def _cameras(robot: RobotDescriptor) -> Iterator[str]:
    if not robot.cameras:
        yield "none"
    for camera in robot.cameras:
        yield (
            f"{camera.name} on {camera.link}: {camera.width} × {camera.height} pixels,"
            f" {camera.fov:.3g} rad field of view, {camera.near:g} … {camera.far:g} m"
        )


def _files(robot: RobotDescriptor, store: AssetStore) -> Iterator[str]:
    urdf = robot.urdf
    if not isinstance(urdf, UrdfLocator):
        yield "the user's own; not in the manifest"
        return
    package = load_manifest().package(urdf.package)
    yield f"local copy {store.root / urdf.package}"
    yield f"licence {package.origin.licence}: {package.origin.licence_note}"
    yield from _summaries(urdf, package, store)
    for file in package.needed(urdf.file, pictures=True):
        yield f"  {describe_file(file, store)}"


def _summaries(urdf: UrdfLocator, package: AssetPackage, store: AssetStore) -> Iterator[str]:
    physics = package.needed(urdf.file, pictures=False)
    pictures = [f for f in package.needed(urdf.file, pictures=True) if f not in physics]
    for title, files in (("physics ", physics), ("pictures", pictures)):
        yield f"{title} {_summary(files, store)}"


def _summary(files: Sequence[AssetFile], store: AssetStore) -> str:
    states = [store.state(file) for file in files]
    counts = [f"{states.count(state)} {state.value}" for state in FileState if state in states]
    return f"{len(files)} files, {size(sum(file.bytes for file in files))}: {', '.join(counts)}"


def _row(values: Iterable[float]) -> str:
    return "(" + ", ".join(f"{round(value, 6) + 0.0:.4g}" for value in values) + ")"
