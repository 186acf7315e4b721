"""A layout as a ROS 2 package: description, MoveIt's configuration, controllers, launch file."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from itertools import product
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from layouts.export.bodies import NOTHING, ExportedWorld
from layouts.export.cell import BODIES, ExportedCell, RobotSource, Standing
from layouts.export.files import LICENCES, licence_note, replaced_folder, short_licences
from layouts.export.meshes import MeshFolder, drawn_meshes, solid_shapes
from layouts.export.ros2.bodies import SCENE, moved_bodies, standing_bodies
from layouts.export.ros2.elements import (
    collision,
    inertial,
    mesh_element,
    paint,
    shape_element,
    xml_text,
)
from layouts.export.ros2.groups import WORLD, PlanningGroups, RosNames
from layouts.visuals import GREY
from robot_layouts.core.pages import fragment
from robot_layouts.kinematics.rotations import inverse_pose, pose_matrix
from robots import LayoutError
from robots.bodies.allowed import joined_pairs, rigid_groups, rigid_pairs
from robots.urdf.model import ModelJoint
from robots.urdf.text import joint_element, origin_of, text

CONFIGS = (
    "joint_limits",
    "kinematics",
    "moveit_controllers",
    "ompl_planning",
    "ros2_controllers",
)
ENTRIES = ("CMakeLists.txt", LICENCES, "config", "launch", "meshes", "package.xml", "urdf")
SPEEDS = {"rad": 1.0, "m": 0.1}  # per second, of joints whose URDF has no largest speed

Shapes = dict[str, list[Element]]


def write_ros2(
    cell: ExportedCell,
    folder: str | os.PathLike[str],
    around: ExportedWorld = NOTHING,
    *,
    visuals: bool = True,
) -> Path:
    """Write a cell as a ROS 2 package; see `layouts.Layout.to_ros2` and `tasks.TaskEnv.to_ros2`."""
    target = Path(folder)
    package = target.absolute().name
    if not re.fullmatch(r"[a-z](_?[a-z0-9])+", package):
        raise LayoutError(
            f"a ROS 2 package cannot be called {package!r}; its folder's name takes two or more"
            f" small letters, digits and single _, and begins with a letter: {_proper(package)!r}"
        )
    with replaced_folder(target, _is_own, "save the package under another name") as made:
        for name in ("config", "launch", "meshes", "urdf"):
            (made / name).mkdir()
        _write(made, cell, around, package, visuals=visuals)
    return target


def _is_own(found: Path) -> bool:
    return found.name in ENTRIES


def _proper(package: str) -> str:
    """Return the valid package name that is closest to an invalid one."""
    plain = re.sub(r"[^a-z0-9]+", "_", package.lower()).strip("_")
    return plain if re.fullmatch(r"[a-z](_?[a-z0-9])+", plain) else f"cell_{plain}".strip("_")


def _write(
    folder: Path, cell: ExportedCell, around: ExportedWorld, package: str, *, visuals: bool
) -> None:
    names = RosNames(cell, around.bodies)
    groups = PlanningGroups(cell, names)
    robots = [source.robot for source in cell.sources]
    meshes = folder / "meshes"
    content = {
        "package": package,
        "licences": LICENCES,
        "licence_names": short_licences(robots),
        "names": names,
        "groups": groups,
        "robots": cell.robots,
        "speeds": dict(_speeds(cell, names)),
        "disabled": [*_allowed_pairs(cell, names), *_pairs_that_stand(cell, names)],
        "scene": SCENE if names.moved else "",
    }
    description = _description(cell, names, package, meshes, visuals=visuals)
    moved: Mapping[str, str] = {}
    if around.bodies:
        files, uri = MeshFolder(meshes / BODIES), f"package://{package}/meshes/{BODIES}"
        description.extend(standing_bodies(around.bodies, names, files, uri))
        moved = moved_bodies(around.bodies, names, files, uri)
    texts = {
        f"urdf/{package}.urdf": xml_text(description),
        f"urdf/{package}.urdf.xacro": _filled("cell.urdf.xacro", content),
        f"config/{package}.srdf": _filled("cell.srdf", content),
        **{f"config/{name}.yaml": _filled(f"{name}.yaml", content) for name in CONFIGS},
        "launch/demo.launch.py": _filled("demo.launch.py", content),
        "package.xml": _filled("package.xml", content),
        "CMakeLists.txt": _filled("CMakeLists.txt", content),
        LICENCES: licence_note(robots, around.things),
        **moved,
    }
    for name, written in texts.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(written, encoding="utf-8")


def _allowed_pairs(cell: ExportedCell, names: RosNames) -> Iterator[tuple[str, str, str]]:
    """Yield the pairs of links that `Layout.validate` lets overlap within a robot, and why.

    They are those that a joint joins (``Adjacent``), those that never move against each other
    (``Never``), and the rest of the robot's ``allowed_collisions`` (``Default``).
    """
    for place, standing in cell.robots.items():
        model = standing.source.model
        joined, rigid = joined_pairs(model), rigid_pairs(model)
        for one, other in sorted(sorted(pair) for pair in standing.source.allowed):
            pair = frozenset((one, other))
            reason = "Adjacent" if pair in joined else "Never" if pair in rigid else "Default"
            yield names.link(place, one), names.link(place, other), reason


def _pairs_that_stand(cell: ExportedCell, names: RosNames) -> Iterator[tuple[str, str, str]]:
    """Yield tables and other bodies that stand, and the links that stand still on them."""
    stand = (*(names.frames[table] for table in cell.tables), *names.standing.values())
    for one, (place, standing) in product(stand, cell.robots.items()):
        model = standing.source.model
        for link in rigid_groups(model)[model.root]:
            if link in model.collisions:
                yield one, names.link(place, link), "Never"


def _speeds(cell: ExportedCell, names: RosNames) -> Iterator[tuple[str, float]]:
    """Yield the largest speed of each joint that follows none, by its name (rad/s, m/s)."""
    for place, standing in cell.robots.items():
        joints = {joint.name: joint for joint in standing.source.model.moving}
        for joint in standing.source.leaders:
            yield names.joint(place, joint), float(_speed_of(joints[joint]))


def _filled(template: str, content: Mapping[str, object]) -> str:
    return f"{fragment(f'layouts.export.ros2/{template}.jinja', **content).rstrip()}\n"


def _description(
    cell: ExportedCell, names: RosNames, package: str, meshes: Path, *, visuals: bool
) -> Element:
    """Return a cell as one URDF, all robots on one link ``world``, and save its meshes.

    Args:
        cell: The cell.
        names: What everything is called.
        package: The package, whose folder ``meshes`` the URDF refers to.
        meshes: That folder.
        visuals: Whether to include what the robots look like.
    """
    root = Element("robot", name=package)
    SubElement(root, "link", name=WORLD)
    root.extend(_frames(cell, names))
    shapes = {
        id(source): _shapes(source, meshes, f"package://{package}/meshes", visuals=visuals)
        for source in cell.sources
    }
    for standing in cell.robots.values():
        root.extend(_robot(standing, names, shapes[id(standing.source)]))
    for tool in cell.tools:
        link = names.tool(tool)
        SubElement(root, "link", name=link)
        pose = pose_matrix(tool.position, (1.0, 0.0, 0.0, 0.0))
        carrier = names.link(tool.place, tool.link)
        root.append(joint_element(names.fixed_joint(link), "fixed", carrier, link, origin_of(pose)))
    return root


def _speed_of(joint: ModelJoint) -> float:
    """Return the largest speed of a joint: that of its URDF, or else `SPEEDS` (rad/s, m/s)."""
    return joint.velocity or SPEEDS[joint.unit]


def _frames(cell: ExportedCell, names: RosNames) -> Iterator[Element]:
    """Yield links for the layout's frames; that of a table is its solid top as well."""
    for name, frame in cell.layout.frame_poses.items():
        link = Element("link", name=names.frames[name])
        pose = pose_matrix(frame.position, frame.quaternion)
        if name in cell.tables:
            middle, size = cell.tables[name]
            own = inverse_pose(pose) @ middle
            for kind in ("visual", "collision"):
                shape = shape_element(kind, own, "box", size=text(*size.tolist()))
                if kind == "visual":
                    paint(shape, names.frames[name], GREY)
                link.append(shape)
        yield link
        made = names.frames[name]
        yield joint_element(names.fixed_joint(made), "fixed", WORLD, made, origin_of(pose))


def _robot(standing: Standing, names: RosNames, shapes: Shapes) -> Iterator[Element]:
    source, place = standing.source, standing.place
    root = names.link(place, source.model.root)
    yield joint_element(names.fixed_joint(root), "fixed", WORLD, root, origin_of(standing.base))
    for name in source.model.links:
        link = Element("link", name=names.link(place, name))
        if name in source.inertials:
            link.append(inertial(source.inertials[name]))
        link.extend(shapes[name])
        yield link
    for joint in source.root.iterfind("joint"):
        model = next(j for j in source.model.joints if j.name == joint.get("name"))
        yield _joint(joint, model, source, place, names)


def _joint(
    element: Element, joint: ModelJoint, source: RobotSource, place: str, names: RosNames
) -> Element:
    made = Element("joint", name=names.joint(place, joint.name), type=joint.type)
    SubElement(made, "parent", link=names.link(place, joint.parent))
    SubElement(made, "child", link=names.link(place, joint.child))
    origin = element.find("origin")
    if origin is not None:
        SubElement(made, "origin", origin.attrib)
    if not joint.moves:
        return made
    SubElement(made, "axis", xyz=text(*joint.axis))
    SubElement(made, "limit", _limit(joint, source))
    if joint.name in source.dynamics:
        damping, friction = source.dynamics[joint.name]
        SubElement(made, "dynamics", damping=repr(damping), friction=repr(friction))
    if joint.mimics is not None:
        law = {"multiplier": repr(joint.multiplier), "offset": repr(joint.offset)}
        SubElement(made, "mimic", {"joint": names.joint(place, joint.mimics), **law})
    return made


def _limit(joint: ModelJoint, source: RobotSource) -> dict[str, str]:
    """Return limits as ROS wants them: with an effort and a speed in any case."""
    drive = source.drives.get(joint.name)
    effort = joint.effort or (drive.force if drive else 0.0)
    limit = {"effort": repr(float(effort)), "velocity": repr(float(_speed_of(joint)))}
    if joint.lower is not None and joint.upper is not None:
        limit.update(lower=repr(joint.lower), upper=repr(joint.upper))
    return limit


def _shapes(source: RobotSource, meshes: Path, uri: str, *, visuals: bool) -> Shapes:
    """Return the shapes of each link; their meshes are saved."""
    files = MeshFolder(meshes / source.name)
    shapes: Shapes = {link: [] for link in source.model.links}
    for link, drawn in drawn_meshes(source, visuals=visuals).items():
        for number, mesh in enumerate(drawn):
            file = files.save(mesh.mesh, f"{link}_visual")
            shape = mesh_element("visual", f"{uri}/{source.name}/{file}")
            paint(shape, f"{source.name}_{link}_{number}", mesh.rgba)
            shapes[link].append(shape)
    for link, solids in solid_shapes(source).items():
        for solid in solids:
            file = files.save(solid.mesh, f"{link}_collision") if solid.mesh is not None else ""
            shapes[link].append(collision(solid, f"{uri}/{source.name}/{file}"))
    return shapes
