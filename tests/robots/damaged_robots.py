"""Robots with one thing wrong each that has a clear meaning, and what is said of its repair."""

from __future__ import annotations

from pathlib import Path

import trimesh

INERTIAL = (
    '<inertial><origin xyz="0 0 0" rpy="0 0 0"/><mass value="1"/>'
    '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
)
BOX = '<box size="0.1 0.2 0.3"/>'
SHAPE = f"<collision><geometry>{BOX}</geometry></collision>"
LIMIT = '<limit lower="-1" upper="1" effort="10" velocity="1"/>'
UPWARDS = LIMIT.replace('lower="-1"', 'lower="0"')
XACRO = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'


def link(name: str, inside: str = INERTIAL + SHAPE) -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(name: str, parent: str, child: str, inside: str = LIMIT, kind: str = "revolute") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>{inside}</joint>'
    )


def robot(*parts: str, about: str = 'name="toy"') -> str:
    return f"<robot {about}>{''.join(parts)}</robot>"


ARM = joint("shoulder", "base", "upper") + link("base") + link("upper")


def with_tip(inside: str) -> str:
    """Return an arm whose last link, ``tip``, holds what is given."""
    return robot(ARM, link("tip", inside), joint("wrist", "upper", "tip"))


def with_wrist(inside: str, kind: str = "revolute", more: str = "") -> str:
    """Return an arm whose last joint, ``wrist``, holds what is given."""
    return robot(ARM, link("tip"), joint("wrist", "upper", "tip", inside, kind), more)


def inertial(mass: str = '<mass value="2"/>', tensor: str = "") -> str:
    return f"<inertial>{mass}{tensor}</inertial>"


def tensor(moments: str, products: str = "0 0 0") -> str:
    keys = zip(
        ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), f"{moments} {products}".split(), strict=True
    )
    return f"<inertia {' '.join(f'{key}={value!r}' for key, value in keys)}/>"


def shape(inside: str, kind: str = "collision") -> str:
    return INERTIAL + SHAPE + f"<{kind}><geometry>{inside}</geometry></{kind}>"


SEEN = SHAPE.replace("collision", "visual")
ENDS = "link {!r} ends what collides, and has no collision: it collides as it looks"
OF_BOX = "took that of a box of 2 kg and the size of its shapes, 0.1 × 0.2 × 0.3 m"
OF_BALL = "took that of a ball of 2 kg and 1000 kg/m³, as it has no shape"

# kind: the URDF, and what is repaired
REPAIRS: dict[str, tuple[str, tuple[str, ...]]] = {
    "no inertia": (with_tip(inertial() + SHAPE), (f"link 'tip' has no inertia: {OF_BOX}",)),
    "no inertia and no shape": (with_tip(inertial()), (f"link 'tip' has no inertia: {OF_BALL}",)),
    "an inertia of zeros": (
        with_tip(inertial(tensor=tensor("0 0 0")) + SHAPE),
        (f"link 'tip' has no inertia: {OF_BOX}",),
    ),
    "a moment below 0": (
        with_tip(inertial(tensor=tensor("0.1 -0.1 0.1")) + SHAPE),
        (
            "link 'tip' has the inertia 0.1, -0.1, 0.1, 0, 0, 0 kg·m² (xx, yy, zz, xy, xz, yz),"
            f" which no body has: {OF_BOX}",
        ),
    ),
    "an inertia without a product": (
        with_tip(INERTIAL.replace('ixy="0"', "") + SHAPE),
        ("link 'tip' has an inertia without ixy, taken as 0",),
    ),
    "no mass": (
        with_tip(inertial("", tensor("0.1 0.1 0.1")) + SHAPE),
        (
            "link 'tip' has no mass: mass and inertia follow from its collision shapes and"
            " 1000 kg/m³",
        ),
    ),
    "no mass, only seen": (
        with_tip(
            inertial('<mass value="0"/>') + SEEN,
        ),
        (
            ENDS.format("tip"),
            "link 'tip' has no mass: mass and inertia follow from its collision shapes and"
            " 1000 kg/m³",
        ),
    ),
    "an end that is only seen": (
        robot(
            joint("shoulder", "base", "upper"),
            joint("mount", "upper", "jaw", kind="fixed", inside=""),
            joint("gripper", "jaw", "tip"),
            link("base"),
            *(link(name, INERTIAL + SEEN) for name in ("upper", "jaw", "tip")),
        ),
        (ENDS.format("upper"), ENDS.format("jaw"), ENDS.format("tip")),
    ),
    "no mass and no shape": (
        with_tip(inertial("", tensor("0.1 0.1 0.1"))),
        ("link 'tip' has no mass, so its <inertial> was left out",),
    ),
    "a mimic out of its limits": (
        with_wrist(UPWARDS + '<mimic joint="shoulder" multiplier="-1"/>').replace(LIMIT, UPWARDS),
        (
            "joint 'wrist' mimics 'shoulder' times -1, out of its own limits; it is taken times 1,"
            " which stays within them",
        ),
    ),
    "other programs' elements": (
        with_wrist(LIMIT, more="<transmission/><transmission/><gazebo/><tendon/>"),
        ("elements of other programs, left out: <gazebo> × 1, <tendon> × 1, <transmission> × 2",),
    ),
    "an empty collision": (
        with_tip(INERTIAL + SHAPE + "<collision/>"),
        ("link 'tip': a collision without a shape, left out",),
    ),
    "a safety zone": (
        with_tip(INERTIAL + SHAPE).replace("tip", "safety_box"),
        ("link 'safety_box': its shape left out, as it is a safety zone and not a body",),
    ),
    "coarse shapes beside finer ones": (
        with_tip(INERTIAL + SHAPE)
        .removesuffix("</robot>")
        .__add__(link("tip_sc", SHAPE) + joint("sc", "tip", "tip_sc", "", "fixed") + "</robot>"),
        ("link 'tip_sc': its shape left out, as 'tip' has shapes that are finer",),
    ),
    "a shape that stands for fingers": (
        with_tip(INERTIAL + SHAPE + SEEN + SHAPE.replace("<geom", '<origin xyz="0 0 0.4"/><geom'))
        .removesuffix("</robot>")
        .__add__(link("jaw", INERTIAL + SEEN) + joint("slide", "tip", "jaw") + "</robot>"),
        (
            "link 'tip': shapes that stand for its fingers, too: it collides as it looks",
            ENDS.format("jaw"),
        ),
    ),
    "a box without size": (
        with_tip(shape('<box size="0 0 0"/>')),
        ("link 'tip': a collision of a box with size='0 0 0', which has no volume, left out",),
    ),
    "a mesh without a file": (
        with_tip(shape('<mesh filename=""/>')),
        ("link 'tip': a collision of a mesh without a file, left out",),
    ),
    "a flat mesh": (
        with_tip(shape('<mesh filename="flat.stl"/>')),
        ("link 'tip': a collision of the mesh 'flat.stl', which has no volume, left out",),
    ),
    "a scale of one number": (
        with_tip(shape('<mesh filename="box.stl" scale="0.5"/>')),
        ("link 'tip': a collision has a mesh with scale='0.5', taken as '0.5 0.5 0.5'",),
    ),
    "a scale of four numbers": (
        with_tip(shape('<mesh filename="box.stl" scale="1 2 3 1"/>')),
        ("link 'tip': a collision has a mesh with scale='1 2 3 1', taken as '1 2 3'",),
    ),
    "two geometries in one visual": (
        with_tip(INERTIAL + SHAPE + shape(f"{BOX}</geometry><geometry>{BOX}", "visual")),
        ("link 'tip': a visual of 2 shapes, taken as 2 visuals",),
    ),
    "a material within a shape": (
        with_tip(shape(BOX + '<material name="red"/>', "visual")),
        ("link 'tip': a visual has a <material> beside its shape, left out",),
    ),
    "a file:// that is relative": (
        with_tip(shape('<mesh filename="file://box.stl"/>')),
        ("the file 'file://box.stl' was found as 'box.stl'",),
    ),
    "a package of another folder": (
        with_tip(shape('<mesh filename="package://toy_package/meshes/box.stl"/>')),
        ("the file 'package://toy_package/meshes/box.stl' was found as '../meshes/box.stl'",),
    ),
    "a package beside": (
        with_tip(shape('<mesh filename="package://parts_package/meshes/ball.stl"/>')),
        (
            "the file 'package://parts_package/meshes/ball.stl' was found as"
            " 'package://parts-1.0/meshes/ball.stl'",
        ),
    ),
    "the case of folders": (
        with_tip(
            shape('<mesh filename="package://Toy_Folder/Meshes/Box.STL"/>')
            + SHAPE.replace(BOX, '<mesh filename="package://Toy_Folder/Meshes/Ball.STL"/>')
        ),
        (
            "the file 'package://Toy_Folder/Meshes/Box.STL' was found as '../meshes/box.stl', and 1"
            " like it",
        ),
    ),
    "a package that xacro would find": (
        with_tip(shape('<mesh filename="file://$(find toy_package)/meshes/box.stl"/>')),
        ("the file 'file://$(find toy_package)/meshes/box.stl' was found as '../meshes/box.stl'",),
    ),
    "backslashes": (
        with_tip(shape(r'<mesh filename="..\meshes\box.stl"/>')),
        ("the file '..\\\\meshes\\\\box.stl' was found as '../meshes/box.stl'",),
    ),
    "properties of xacro": (
        robot(
            '<xacro:property name="pi" value="${2 * 1.57}"/><xacro:property name="one" value="1"/>',
            with_wrist(LIMIT).removeprefix('<robot name="toy">').removesuffix("</robot>"),
            about=f'name="toy" {XACRO}',
        ),
        ("left over from xacro, left out: <xacro:property> × 2",),
    ),
    "an undeclared prefix": (
        with_wrist(LIMIT, more='<xacro:property name="pi" value="3.14"/>'),
        (
            "namespaces that were not declared: xacro",
            "left over from xacro, left out: <xacro:property> × 1",
        ),
    ),
    "a namespace of its own": (
        with_wrist(LIMIT).replace('name="toy"', 'name="toy" xmlns="http://drake.mit.edu"'),
        ("the namespace 'http://drake.mit.edu' of <robot>, left out",),
    ),
    "commas": (
        with_wrist(LIMIT).replace('xyz="0 0 0.4"', 'xyz="0, 0, 0.4"'),
        ("commas between the numbers of vectors, left out: 2 times",),
    ),
    "blank lines at the top": (
        '\n\n<?xml version="1.0"?>' + with_wrist(LIMIT),
        ("blank lines before <?xml …?>, left out",),
    ),
    "limits 0 … 0": (
        with_wrist('<limit lower="0" upper="0" effort="1" velocity="1"/><dynamics damping="1"/>'),
        (
            "joint 'wrist' has the limits 0 … 0, which are those of a <limit> that has none, so it"
            " is fixed (if it should turn freely, make it continuous)",
        ),
    ),
    "a follower of a fixed joint": (
        with_wrist('<limit lower="0" upper="0"/>')
        .removesuffix("</robot>")
        .__add__(
            link("jaw")
            + joint("jaws", "tip", "jaw", LIMIT + '<mimic joint="wrist" multiplier="2"/>')
            + "</robot>"
        ),
        (
            "joint 'wrist' has the limits 0 … 0, which are those of a <limit> that has none, so it"
            " is fixed (if it should turn freely, make it continuous)",
            "joint 'jaws' mimics a joint that is fixed, so it is fixed",
        ),
    ),
    "a fixed joint that mimics": (
        with_wrist('<mimic joint="shoulder"/>', "fixed"),
        ("joint 'wrist' is fixed, so what it mimics counts for nothing",),
    ),
    "limits of a continuous joint": (
        with_wrist('<limit lower="-3" upper="3" effort="1" velocity="1"/>', "continuous"),
        ("joint 'wrist' is continuous, so its limits -3 … 3 rad count for nothing",),
    ),
    "a floating base": (
        robot(ARM, link("map"), joint("floor", "map", "base", "", "floating")),
        (
            "joint 'floor', by which the whole robot is floating, is fixed: a layout says where it"
            " stands",
        ),
    ),
    "a planar base": (
        robot(ARM, link("map"), joint("floor", "map", "base", "", "planar")),
        (
            "joint 'floor', by which the whole robot is planar, is fixed: a layout says where it"
            " stands",
        ),
    ),
}

# what SAPIEN and the model read without a repair
FINE = {
    "no effort and no velocity": with_wrist('<limit lower="-1" upper="1"/>'),
    "friction only": with_wrist(LIMIT + '<dynamics friction="0.1"/>'),
    "odd names": with_wrist(LIMIT).replace('"tip"', '"tool 0/ä:&lt;b&gt;"'),
    "a mirrored mesh": with_tip(shape('<mesh filename="box.stl" scale="1 -1 1"/>')),
}

# kind: a URDF whose meaning is not clear, and why it is refused
REFUSED = {
    "no limits": (
        with_wrist(""),
        "joint 'wrist' has the limits 0 … 0 rad, which leave no way to go",
    ),
    "a part that floats": (
        with_wrist("", "floating"),
        "joint 'wrist' is 'floating'; only revolute, continuous, prismatic and fixed",
    ),
    "a second shape of an unknown kind": (
        with_tip(shape(f"{BOX}</geometry><geometry><cone/><cone/>")),
        "a collision with 3 shapes (box, cone, cone)",
    ),
    "a box below 0": (with_tip(shape('<box size="1 1 -1"/>')), "without a volume: a box"),
    "a file of the system": (
        with_tip(shape('<mesh filename="package://toy_package/../../../etc/passwd"/>')),
        "which leads out of its folder and its package",
    ),
}


def write_damaged(folder: Path, text: str) -> Path:
    """Write a URDF with the files that some of these robots refer to, and return its path."""
    package, parts = folder / "toy_folder", folder / "parts-1.0"
    own = package / "urdf"
    own.mkdir(parents=True)
    for place, name in ((package, "toy_package"), (parts, "parts_package")):
        (place / "meshes").mkdir(parents=True)
        (place / "package.xml").write_text(f"<package><name>{name}</name></package>")
    for file in (package / "meshes/box.stl", package / "meshes/ball.stl", own / "box.stl"):
        trimesh.creation.box((0.1, 0.2, 0.3)).export(file)
    trimesh.creation.icosphere(radius=0.1).export(parts / "meshes/ball.stl")
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    flat.export(own / "flat.stl")
    urdf = own / "toy.urdf"
    urdf.write_text(text)
    return urdf
