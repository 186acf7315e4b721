"""Robots of a few boxes, written to disk by a test, whose distances can be told by hand."""

from dataclasses import replace
from pathlib import Path

from robots.assets.locator import LocalUrdf
from robots.descriptor import ActionSplit, JointGroup, RobotDescriptor

BOX = '<box size="0.1 0.1 0.1"/>'


def link(name, shape=BOX, xyz="0 0 0"):
    collision = f'<collision><origin xyz="{xyz}"/><geometry>{shape}</geometry></collision>'
    return f'<link name="{name}">{collision if shape else ""}</link>'


def joint(name, parent, child, xyz="0 0 0", kind="revolute", axis="0 0 1", more=""):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/><limit lower="-4" upper="4"/>{more}</joint>'
    )


def urdf(*parts):
    return f'<?xml version="1.0"?><robot name="small">{"".join(parts)}</robot>'


# A box on the ground, and one 0.3 m above it that turns about z.
TURNTABLE = urdf(
    link("base", xyz="0 0 0.05"), link("top"), joint("turn", "base", "top", xyz="0 0 0.35")
)

# Three boxes in a row along x, at 0, 0.2 and 0.8 m. The second turns about its own middle, and the
# third about a point half-way, so that it can be folded back onto the first.
FOLDING = urdf(
    link("base"),
    link("upper"),
    link("lower", xyz="0.4 0 0"),
    joint("shoulder", "base", "upper", xyz="0.2 0 0"),
    joint("elbow", "upper", "lower", xyz="0.2 0 0"),
)


def robot(folder: Path, text, joints, rest=None, tcp=None, **changes) -> RobotDescriptor:
    """Write a URDF and describe it: all joints in one group, one keyframe called rest."""
    path = folder / "small.urdf"
    path.write_text(text)
    arm = JointGroup(
        tuple(joints), lower=-0.1, upper=0.1, stiffness=1, damping=1, force_limit=1, delta=True
    )
    descriptor = RobotDescriptor(
        name="small",
        urdf=LocalUrdf(path),
        action_split=ActionSplit(arm=arm),
        tcp_link=tcp or "top",
        keyframes={"rest": rest or [0.0] * len(joints)},
        reach=0.5,
        source="made up",
    )
    return replace(descriptor, **changes)


def turntable(folder: Path, **changes) -> RobotDescriptor:
    return robot(folder, TURNTABLE, ["turn"], **changes)


def folding(folder: Path, elbow=0.0, **changes) -> RobotDescriptor:
    return robot(folder, FOLDING, ["shoulder", "elbow"], rest=[0.0, elbow], tcp="lower", **changes)
