"""URDFs of small arms, for tests that try robots out."""

from __future__ import annotations

from pathlib import Path

LENGTH = 0.2  # of a link (m)


def arm(*, joints: int = 3, mimics: str = "", speed: float = 3.0) -> str:
    """Return the URDF of a planar arm of boxes along x, which turns about z.

    Args:
        joints: How many it has: ``j1``, ``j2``, …
        mimics: URDF of what else the last joint has.
        speed: Largest, of every joint (rad/s).
    """
    links = "".join(_link(f"l{i}") for i in range(joints + 1))
    turning = "".join(_joint(i, speed, mimics if i == joints else "") for i in range(1, joints + 1))
    return f'<robot name="small">{links}{turning}</robot>'


def save(folder: Path, text: str, name: str = "small.urdf") -> Path:
    """Save a URDF in a folder and return its path."""
    path = folder / name
    path.write_text(text)
    return path


def _link(name: str) -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="0.1 0 0"/><mass value="1"/>'
        '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>'
        '<collision><origin xyz="0.1 0 0"/><geometry><box size="0.16 0.04 0.04"/></geometry>'
        "</collision></link>"
    )


def _joint(number: int, speed: float, more: str) -> str:
    return (
        f'<joint name="j{number}" type="revolute"><parent link="l{number - 1}"/>'
        f'<child link="l{number}"/><origin xyz="{LENGTH} 0 0"/><axis xyz="0 0 1"/>'
        f'<limit lower="-3.1" upper="3.1" effort="100" velocity="{speed}"/>{more}</joint>'
    )
