"""A robot of three links, written to disk with one thing wrong, and all who read it."""

from __future__ import annotations

from pathlib import Path

from layouts import Layout, Placement
from robots import ActionSplit, JointGroup, LocalUrdf, RobotDescriptor, RobotLayoutsError
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf

INERTIAL = (
    '<inertial><origin xyz="0 0 0" rpy="0 0 0"/><mass value="1"/>'
    '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
)
BOX = '<box size="0.1 0.1 0.1"/>'
LIMIT = '<limit lower="-1" upper="1" effort="10" velocity="1"/>'


def joint(name: str, parent: str, child: str, inside: str = LIMIT, kind: str = "revolute") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 0.3" rpy="0 0 0"/><axis xyz="0 1 0"/>{inside}</joint>'
    )


def link(name: str, shape: str = BOX, more: str = "") -> str:
    origin = '<origin xyz="0 0 0.1" rpy="0 0 0"/>'
    collision = f"<collision>{origin}<geometry>{shape}</geometry></collision>"
    return f'<link name="{name}">{INERTIAL}{more}{collision}</link>'


def robot(*parts: str) -> str:
    return f'<robot name="toy">{"".join(parts)}</robot>'


def toy(shape: str = BOX, more: str = "") -> str:
    """Return the URDF of base, arm and hand; the arm has the shape, and more inside its link."""
    return robot(
        link("base"),
        link("arm", shape, more),
        link("hand"),
        joint("shoulder", "base", "arm"),
        joint("wrist", "arm", "hand"),
    )


def mesh(file: str, more: str = "") -> str:
    return f'<mesh filename="{file}"{more}/>'


def descriptor(urdf: Path) -> RobotDescriptor:
    """Return what the toy is, written by hand."""
    group = JointGroup(
        ("shoulder", "wrist"), lower=-1.0, upper=1.0, stiffness=1.0, damping=1.0, force_limit=1.0
    )
    return RobotDescriptor(
        name="toy",
        urdf=LocalUrdf(urdf),
        action_split=ActionSplit(arm=group),
        tcp_link="hand",
        keyframes={"rest": (0.0, 0.0)},
        reach=1.0,
        source="written for these tests",
    )


def guess(urdf: Path) -> None:
    RobotDescriptor.from_urdf(urdf, quiet=True)


def check(urdf: Path) -> None:
    Layout({"toy": Placement(descriptor(urdf))}).validate(samples=1, workspaces=False)


def build(urdf: Path) -> None:
    """Build a world and see that links have the shapes of their URDF; flat ones are left out."""
    from robot_layouts.simulation.sapien3.world import BuiltWorld

    world = BuiltWorld(Layout({"toy": Placement(descriptor(urdf))}))
    model = read_model(read_urdf(urdf), urdf.as_posix())
    for link_name, made in world.robots["toy"].links.items():
        shapes = len(model.collisions.get(link_name, ()))
        assert len(made.collision_shapes) == shapes, f"{link_name} lacks a shape"


def read_by_all(urdf: Path, readers: tuple[str, ...] = ("guess", "check", "build")) -> None:
    """Have a URDF read by all who read one; if one refuses, all must, in the same words.

    Raises:
        RobotLayoutsError: What they refuse it with.
    """
    errors: dict[str, RobotLayoutsError | None] = {}
    for reader in readers:
        try:
            globals()[reader](urdf)
        except RobotLayoutsError as error:
            errors[reader] = error
        else:
            errors[reader] = None
    assert len(set(map(str, errors.values()))) == 1, f"readers do not agree: {errors}"
    for error in errors.values():
        if error is not None:
            raise error


def read_repaired(urdf: Path) -> str:
    """Have a URDF guessed, checked and built that needs a repair; return what was repaired."""
    from robot_layouts.simulation.sapien3.world import BuiltWorld
    from robots.urdf.summary import read_cleaned

    guess(urdf)
    check(urdf)
    BuiltWorld(Layout({"toy": Placement(descriptor(urdf))}))
    repairs = read_cleaned(urdf).repairs
    assert repairs, "nothing was repaired"
    return "repaired: " + "; ".join(repairs)


def write_mesh(path: Path) -> None:
    """Write a box as a mesh; the ending chooses the format."""
    import trimesh

    path.parent.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box((0.1, 0.2, 0.3)).export(path)
