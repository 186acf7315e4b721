"""The URDF of a cell for ROS 2: all robots on one link ``world``, with meshes of the package."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from layouts.export.cell import ExportedCell, RobotSource, Standing
from layouts.export.meshes import MeshFolder, drawn_meshes, solid_shapes
from layouts.export.ros2.groups import WORLD, RosNames
from layouts.visuals import GREY, Rgba
from robot_layouts.kinematics.rotations import Floats, inverse_pose, pose_matrix
from robots.urdf.model import LinkInertia, ModelJoint
from robots.urdf.writing import joint_element, origin_of, text

SPEEDS = {"rad": 1.0, "m": 0.1}  # per second, of joints whose URDF has no largest speed

Shapes = dict[str, list[Element]]


def description(
    cell: ExportedCell, names: RosNames, package: str, meshes: Path, *, visuals: bool
) -> Element:
    """Return a cell as one URDF, and save its meshes.

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


def speed_of(joint: ModelJoint) -> float:
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
                shape = _shape(kind, own, "box", size=text(*size.tolist()))
                if kind == "visual":
                    _paint(shape, names.frames[name], GREY)
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
            link.append(_inertial(source.inertials[name]))
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
    limit = {"effort": repr(float(effort)), "velocity": repr(float(speed_of(joint)))}
    if joint.lower is not None and joint.upper is not None:
        limit.update(lower=repr(joint.lower), upper=repr(joint.upper))
    return limit


def _inertial(inertial: LinkInertia) -> Element:
    made = Element("inertial")
    SubElement(made, "origin", xyz=text(*inertial.origin[:3, 3].tolist()), rpy="0 0 0")
    SubElement(made, "mass", value=repr(inertial.mass))
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    numbers = inertial.tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()
    SubElement(made, "inertia", {k: repr(x) for k, x in zip(keys, numbers, strict=True)})
    return made


def _shapes(source: RobotSource, meshes: Path, uri: str, *, visuals: bool) -> Shapes:
    """Return the shapes of each link; their meshes are saved."""
    files = MeshFolder(meshes / source.name)
    shapes: Shapes = {link: [] for link in source.model.links}
    for link, drawn in drawn_meshes(source, visuals=visuals).items():
        for number, mesh in enumerate(drawn):
            file = files.save(mesh.mesh, f"{link}_visual")
            shape = _mesh("visual", f"{uri}/{source.name}/{file}")
            _paint(shape, f"{source.name}_{link}_{number}", mesh.rgba)
            shapes[link].append(shape)
    for link, solids in solid_shapes(source).items():
        for solid in solids:
            own = solid.shape
            if solid.hull is not None:
                file = files.save(solid.hull, f"{link}_collision")
                shapes[link].append(_mesh("collision", f"{uri}/{source.name}/{file}"))
            elif own.kind == "box":
                shapes[link].append(_shape("collision", own.origin, "box", size=text(*own.sizes)))
            else:
                keys = ("radius", "length")[: len(own.sizes)]
                sizes = {key: repr(float(x)) for key, x in zip(keys, own.sizes, strict=True)}
                shapes[link].append(_shape("collision", own.origin, own.kind, **sizes))
    return shapes


def _mesh(kind: str, uri: str) -> Element:
    shape = Element(kind)
    SubElement(SubElement(shape, "geometry"), "mesh", filename=uri)
    return shape


def _shape(kind: str, pose: Floats, geometry: str, **sizes: str) -> Element:
    shape = Element(kind)
    SubElement(shape, "origin", origin_of(pose))
    SubElement(SubElement(shape, "geometry"), geometry, sizes)
    return shape


def _paint(shape: Element, name: str, rgba: Rgba) -> None:
    material = SubElement(shape, "material", name=name)
    SubElement(material, "color", rgba=text(*rgba))
