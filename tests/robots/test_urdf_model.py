"""Bad URDFs are refused in clear words, by all who read them, and nothing is fetched or run."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from robots import AssetError, DescriptorError, LocalUrdf, RobotDescriptor
from robots.urdf.reading import read_model

CHECKOUT = Path(__file__).parents[2]

INERTIAL = """<inertial><mass value="1"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>"""
SHAPE = "<collision><geometry><box size='0.1 0.1 0.1'/></geometry></collision>"
LINKS = f"""<link name="base"/><link name="upper">{INERTIAL}{SHAPE}</link>
<link name="lower">{INERTIAL}{SHAPE}</link>"""
LIMIT = '<limit lower="-1" upper="1" effort="10" velocity="1"/>'


def joint(name: str, parent: str, child: str, inside: str = LIMIT, kind: str = "revolute") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>{inside}</joint>'
    )


SHOULDER, ELBOW = joint("shoulder", "base", "upper"), joint("elbow", "upper", "lower")
GOOD = LINKS + SHOULDER + ELBOW


def robot(body: str) -> str:
    return f'<robot name="toy">{body}</robot>'


BAD = {
    "malformed": ("<robot><link", "is not a URDF: "),
    "not a robot": ("<mujoco/>", "it holds <mujoco>, not <robot>"),
    "external entity": (
        '<!DOCTYPE r [<!ENTITY e SYSTEM "file:///etc/passwd">]>' + robot(f"&e;{GOOD}"),
        "declares XML entities; a URDF has no use for them",
    ),
    "no link": (robot(""), "has no link"),
    "joints of one name": (
        robot(GOOD.replace('"elbow"', '"shoulder"')),
        "has more than one joint called 'shoulder'; every joint needs a name of its own",
    ),
    "links of one name": (robot(GOOD + '<link name="base"/>'), "more than one link called 'base'"),
    "joint without a name": (robot(GOOD.replace('"elbow"', '""')), "has a joint without a name"),
    "unknown link": (
        robot(LINKS + SHOULDER + joint("elbow", "uper", "lower")),
        "joint 'elbow' names the link 'uper', which does not exist; did you mean 'upper'?",
    ),
    "two parents": (
        robot(GOOD + joint("third", "base", "lower")),
        "more than one joint carries the link 'lower'; a URDF is a tree",
    ),
    "two roots": (robot(GOOD + '<link name="stray"/>'), "['base', 'stray'] are without a joint"),
    "only a circle": (
        robot(LINKS + SHOULDER + ELBOW + joint("back", "lower", "base")),
        "no link is without a joint that carries it",
    ),
    "circle beside the root": (
        robot(
            GOOD + '<link name="a"/><link name="b"/>' + joint("x", "a", "b") + joint("y", "b", "a")
        ),
        "the joints of links ['a', 'b'] go in a circle",
    ),
    "no limits": (
        robot(LINKS + SHOULDER + joint("elbow", "upper", "lower", "")),
        "joint 'elbow' has the limits 0 … 0 rad, which leave no way to go",
    ),
    "limits the wrong way": (
        robot(GOOD.replace('lower="-1"', 'lower="2"')),
        "joint 'shoulder' has the limits 2 … 1 rad",
    ),
    "a limit that is no number": (
        robot(GOOD.replace('upper="1"', 'upper="wide"')),
        "joint 'shoulder' has upper='wide' in <limit>; 1 finite number is needed",
    ),
    "an origin of two numbers": (
        robot(GOOD.replace('xyz="0 0 0.3"', 'xyz="0 0.3"')),
        "has xyz='0 0.3' in <origin>; 3 finite numbers are needed",
    ),
    "no axis": (robot(GOOD.replace("0 1 0", "0 0 0")), "has the axis 0 0 0"),
    "unknown type": (
        robot(LINKS + SHOULDER + joint("elbow", "upper", "lower", kind="hinge")),
        "joint 'elbow' is 'hinge' (the types are revolute, ",
    ),
    "a type that nothing drives": (
        robot(LINKS + SHOULDER + joint("elbow", "upper", "lower", kind="planar")),
        "joint 'elbow' is 'planar'; only revolute, continuous, prismatic and fixed",
    ),
    "mimic of nothing": (
        robot(LINKS + SHOULDER + joint("elbow", "upper", "lower", LIMIT + "<mimic joint='x'/>")),
        "joint 'elbow' mimics 'x', which is no joint that moves",
    ),
    "mimic of itself": (
        robot(
            LINKS + SHOULDER + joint("elbow", "upper", "lower", LIMIT + "<mimic joint='elbow'/>")
        ),
        "joint 'elbow' mimics itself",
    ),
    "a mass below 0": (
        robot(GOOD.replace('mass value="1"', 'mass value="-1"')),
        "link 'upper' moves, but has mass -1 kg and moments of inertia 0.1, 0.1, 0.1 kg·m²",
    ),
    "too many links": (
        robot(
            LINKS
            + "".join(
                f'<link name="l{i}"/>' + joint(f"j{i}", f"l{i - 1}" if i else "base", f"l{i}")
                for i in range(1_000)
            )
        ),
        "has 1003 links; PhysX joins 255 at most",
    ),
    "a limit beyond all measure": (
        robot(GOOD.replace('upper="1"', 'upper="1e300"')),
        "upper='1e300' in <limit>; 1e+18 is the largest amount that makes sense",
    ),
    "a number as Python alone writes it": (
        robot(GOOD.replace('upper="1"', 'upper="1_0"')),
        "upper='1_0' in <limit>; 1 finite number is needed",
    ),
    "an effort below 0": (
        robot(GOOD.replace('effort="10"', 'effort="-10"')),
        "joint 'shoulder' has effort=-10 in <limit>, below 0",
    ),
    "a box without a size": (robot(GOOD.replace("size='0.1 0.1 0.1'", "")), "has no size in <box>"),
    "an unknown shape": (
        robot(GOOD.replace("<box size='0.1 0.1 0.1'/>", "<cone/>")),
        "link 'upper': a collision of shape 'cone'; choices: box, sphere, cylinder, capsule, mesh",
    ),
    "a name with a newline": (
        robot(GOOD.replace('link name="lower"', 'link name="lo&#10;wer"')),
        "has a link called 'lo\\nwer'; names have at most 200 characters, all of them printable",
    ),
    "missing mesh": (
        robot(
            GOOD.replace(
                SHAPE, SHAPE.replace("<box size='0.1 0.1 0.1'/>", "<mesh filename='no.stl'/>")
            )
        ),
        "refers to files that do not exist: ",
    ),
    "mesh from the network": (
        robot(
            GOOD.replace(
                SHAPE,
                SHAPE.replace(
                    "<box size='0.1 0.1 0.1'/>", "<mesh filename='http://127.0.0.1:9/a.stl'/>"
                ),
            )
        ),
        "toy.urdf refers to 'http://127.0.0.1:9/a.stl'; only paths, package:// and file://",
    ),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_urdf_is_refused(kind, tmp_path):
    text, reason = BAD[kind]
    path = tmp_path / "toy.urdf"
    path.write_text(text)
    for read in (lambda: LocalUrdf(path).locate(), lambda: RobotDescriptor.from_urdf(path)):
        with pytest.raises(AssetError) as error:
            read()
        assert reason in str(error.value)
        assert str(path) in str(error.value)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('mass value="1"', 'mass value="0"', "moves, but has mass 0 kg and moments of inertia 0.1"),
        ('izz="0.1"', 'izz="0"', "moves, but has mass 1 kg and moments of inertia 0.1, 0.1, 0"),
        ('ixy="0"', 'ixy="5"', "which no body has: around some axis it is not positive"),
        ('ixy="0"', "", "has no ixy in <inertia>"),
        ("<box size='0.1 0.1 0.1'/>", "", "a collision without a shape"),
    ],
)
def test_a_text_that_was_not_repaired_is_refused(old, new, reason):
    with pytest.raises(AssetError) as error:
        read_model(robot(GOOD.replace(old, new)).encode(), "toy.urdf")
    assert reason in str(error.value)


def test_what_is_only_odd_is_accepted(tmp_path):
    path = tmp_path / "toy.urdf"
    path.write_text(robot(GOOD))
    guessed = RobotDescriptor.from_urdf(path, quiet=True)
    assert guessed.joints == ("shoulder", "elbow")
    assert guessed.tcp_link == "lower"
    massless = GOOD.replace(SHAPE, "").replace('mass value="1"', 'mass value="0"')
    assert read_model(robot(massless.replace('"0.1"', '"0"')).encode(), "toy").root == "base"


def test_one_joint_is_a_robot(tmp_path, capsys):
    path = tmp_path / "toy.urdf"
    path.write_text(robot(LINKS + SHOULDER + ELBOW.replace("revolute", "fixed")))
    assert RobotDescriptor.from_urdf(path).joints == ("shoulder",)
    assert capsys.readouterr().err.startswith("toy: 1 joint, 1 action number, all guessed\n")


def test_nothing_to_drive_is_an_error(tmp_path):
    path = tmp_path / "toy.urdf"
    path.write_text(
        robot(LINKS + SHOULDER.replace("revolute", "fixed") + ELBOW.replace("revolute", "fixed"))
    )
    with pytest.raises(DescriptorError, match=r"toy\.urdf has no joint that moves"):
        RobotDescriptor.from_urdf(path)


WATCH = """
import sys
seen = []
def watch(event, arguments):
    if event.startswith(("socket.", "subprocess.", "os.exec", "os.system", "os.posix_spawn")):
        seen.append(event)
    elif event == "open" and str(arguments[0]) in ("/etc/passwd", "no.stl"):
        seen.append(str(arguments[0]))
from robots import LocalUrdf, RobotDescriptor
from robot_layouts.core.errors import RobotLayoutsError
import robots.from_urdf
sys.addaudithook(watch)
for path in sys.argv[1:]:
    for read in (lambda: LocalUrdf(path).locate(), lambda: RobotDescriptor.from_urdf(path)):
        try:
            read()
        except RobotLayoutsError as error:
            assert "root:" not in str(error)
        else:
            seen.append(f"accepted {path}")
print(seen)
"""


def test_nothing_is_fetched_or_run(tmp_path):
    paths = []
    for kind, (text, _) in BAD.items():
        paths.append(tmp_path / f"{kind.replace(' ', '_')}.urdf")
        paths[-1].write_text(text)
    done = subprocess.run(
        [sys.executable, "-c", WATCH, *map(str, paths)],
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == "[]\n", done.stderr


def test_a_mesh_of_a_ros_package_is_found_above_the_urdf(tmp_path):
    meshes = tmp_path / "toy_description" / "meshes"
    meshes.mkdir(parents=True)
    (meshes / "arm.stl").touch()
    path = tmp_path / "toy_description" / "urdf" / "toy.urdf"
    path.parent.mkdir()
    mesh = "<mesh filename='package://toy_description/meshes/arm.stl'/>"
    path.write_text(robot(GOOD.replace("<box size='0.1 0.1 0.1'/>", mesh)))
    assert LocalUrdf(path).locate() == path


def test_a_chain_as_long_as_physx_allows_is_read_at_once():
    links = [f'<link name="l{i}"/>' for i in range(255)]
    joints = [joint(f"j{i}", f"l{i}", f"l{i + 1}") for i in range(254)]
    model = read_model(robot("".join(links + joints)).encode(), "toy")
    assert [at.name for at in model.ordered] == [f"j{i}" for i in range(254)]
    assert model.depths["j0"] == 254
    assert model.depths["j253"] == 1
