"""Writes small URDFs for tests: arms, hands, heads and legs, put together part by part."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from pathlib import Path

BOX = "0.04 0.04 0.04"


@dataclass
class Parts:
    """The links and joints of a robot that is being written."""

    links: list[str] = field(default_factory=list)
    joints: list[str] = field(default_factory=list)

    def link(self, name: str, mass: float = 0.5, size: str = BOX, at: str = "0 0 0") -> str:
        """Add a link with a box, at a place in its frame (m), and return its name."""
        moment = mass * 0.001
        self.links.append(
            f'<link name="{name}"><inertial><origin xyz="{at}"/><mass value="{mass}"/>'
            f'<inertia ixx="{moment}" iyy="{moment}" izz="{moment}" ixy="0" ixz="0" iyz="0"/>'
            f'</inertial><collision><origin xyz="{at}"/><geometry><box size="{size}"/></geometry>'
            "</collision></link>"
        )
        return name

    def frame(self, name: str, parent: str, at: str) -> str:
        """Fix a frame without a body to a link, and return its name."""
        self.links.append(f'<link name="{name}"/>')
        self.joint(f"{name}_fixed", parent, name, at, kind="fixed")
        return name

    def joint(
        self,
        name: str,
        parent: str,
        child: str,
        at: str,
        *,
        axis: str = "0 0 1",
        limits: tuple[float, float] = (-2.0, 2.0),
        kind: str = "revolute",
        mimic: str = "",
        effort: float = 100.0,
    ) -> None:
        """Join two links at a place in the parent's frame (m)."""
        limit = f'<limit lower="{limits[0]}" upper="{limits[1]}" effort="{effort}" velocity="3"/>'
        moving = "" if kind == "fixed" else f'<axis xyz="{axis}"/>{limit}{mimic}'
        self.joints.append(
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{at}"/>{moving}</joint>'
        )

    def arm(self, parent: str, name: str, at: str, *, yaw: tuple[float, float] = (-2, 2)) -> str:
        """Add an arm of six joints that reaches out along x, and return its last link."""
        axes = ("0 0 1", "0 1 0", "0 1 0", "0 1 0", "1 0 0", "0 1 0")
        for i, axis in enumerate(axes, start=1):
            child = self.link(f"{name}_link{i}", at="0.06 0 0" if i > 1 else "0 0 0.04")
            limits = yaw if i == 1 else (-1.8, 1.8)
            self.joint(f"{name}_joint{i}", parent, child, at, axis=axis, limits=limits)
            parent, at = child, ("0 0 0.08" if i == 1 else "0.12 0 0")
        return parent

    def jaws(self, palm: str, name: str, *, mimic: bool = True) -> None:
        """Add two fingers that slide apart along y."""
        for side, sign in (("one", 1), ("two", -1)):
            child = self.link(f"{name}_finger_{side}", 0.05, "0.06 0.01 0.02", "0.03 0 0")
            follows = f'<mimic joint="{name}_slide_one"/>' if mimic and side == "two" else ""
            self.joint(
                f"{name}_slide_{side}",
                palm,
                child,
                f"0.05 {0.006 * sign} 0",
                axis=f"0 {sign} 0",
                limits=(0.0, 0.04),
                kind="prismatic",
                mimic=follows,
            )

    def write(self, folder: Path, *, shuffled: int | None = None) -> Path:
        """Write the URDF, its links and joints in any order if it is to be shuffled."""
        links, joints = list(self.links), list(self.joints)
        if shuffled is not None:
            random.Random(shuffled).shuffle(links)
            random.Random(shuffled + 1).shuffle(joints)
        path = folder / "robot.urdf"
        path.write_text(f'<robot name="made">{"".join((*links, *joints))}</robot>', "utf-8")
        return path
