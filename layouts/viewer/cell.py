"""What a page shows: a layout, things that stand around, a motion of both, and texts.

Names are shown as they are, whatever is in them, and never taken for markup.
"""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import Any
from urllib.parse import quote

import numpy as np

from layouts.layout import Layout
from layouts.validation.collisions import stand, touching
from layouts.visuals import Visual, read_visuals
from robot_layouts.core import commands
from robot_layouts.kinematics.rotations import Floats
from robots import AssetError, LayoutError
from robots.bodies.hulls import RobotModel, load_model

STYLE = "padding: 0 0.75rem 0.5rem; font-size: 0.875rem; overflow-wrap: anywhere"


@dataclass(frozen=True, eq=False)
class Thing:
    """A body that is no robot.

    Attributes:
        parts: What it looks like, in its own frame.
        pose: Where it is: position (m, world), then quaternion (wxyz), (7,).
    """

    parts: tuple[Visual, ...]
    pose: Floats


@dataclass(frozen=True, eq=False)
class ShownMotion:
    """Positions of robots and things over T + 1 moments.

    Attributes:
        step_seconds: Time from one moment to the next (s).
        qpos: By robot, joint positions in the descriptor's order, (T + 1, dof) (rad, m).
        poses: By thing, position (m, world) and quaternion (wxyz), (T + 1, 7); what is left out
            does not move.
        name: What a page calls it.
    """

    step_seconds: float
    qpos: Mapping[str, Floats]
    poses: Mapping[str, Floats] = field(default_factory=dict[str, Floats])
    name: str = "Demonstration"

    def __len__(self) -> int:
        """Return the number of moments, T + 1."""
        return len(next(iter(self.qpos.values())))


@dataclass(frozen=True, eq=False)
class LinkContact:
    """Two links that overlap.

    Attributes:
        robots: Names of their robots; twice the same in a self-collision.
        links: Their names.
        depth: By how much (m).
    """

    robots: tuple[str, str]
    links: tuple[str, str]
    depth: float


class ShownCell:
    """A layout and what is around it.

    Attributes:
        title: What a page calls it.
        layout: The robots.
        things: Other bodies, by name.
        motion: What they do, or None.
        start: By robot, the joint positions to begin with, in the descriptor's order (rad, m).
        models: By robot, its links and hulls.
        ways: By robot, lines in its colour, such as the way of its TCP, each (n, 3) (m, world).
        hidden: Overlays of `layouts.viewer.scene` that are not shown at first.
        visuals: By robot and link, what it looks like; empty where its files lack that.
        notes: Remarks on the robots' files, for a person.
    """

    def __init__(
        self,
        title: str,
        layout: Layout,
        things: Mapping[str, Thing] | None = None,
        motion: ShownMotion | None = None,
        start: Mapping[str, Floats] | None = None,
        ways: Mapping[str, Sequence[Floats]] | None = None,
        hidden: Sequence[str] = (),
    ) -> None:
        """Load the robots' collision shapes.

        Args:
            title: What a page calls it.
            layout: The robots.
            things: Other bodies, by name.
            motion: What they do.
            start: By robot, joint positions to begin with; by default those of the motion's first
                moment, else of the keyframe.
            ways: By robot, lines in its colour, each (n, 3) (m, world).
            hidden: Overlays of `layouts.viewer.scene` that are not shown at first.

        Raises:
            LayoutError: If the motion is of other robots, or of no moments.
            AssetError: If a robot's files cannot be found or are invalid.
            DescriptorError: If a descriptor contradicts its URDF.
            MissingPackageError: If python-fcl is not installed.
        """
        self.title, self.layout = printable(title), layout
        self.things = dict(things or {})
        self.motion = motion
        self.ways = {name: tuple(lines) for name, lines in (ways or {}).items()}
        self.hidden = tuple(hidden)
        self.models: dict[str, RobotModel] = {n: load_model(p.robot) for n, p in layout.items()}
        self.visuals: dict[str, Mapping[str, tuple[Visual, ...]]] = {}
        self.notes: list[str] = []
        for name, placement in layout.items():
            try:
                self.visuals[name] = read_visuals(placement.robot.urdf.locate(pictures=True))
            except AssetError as error:
                self.visuals[name] = {}
                note = f"{name} is shown by its collision shapes: {error}"
                self.notes.append(printable(note))
        if motion is not None:
            _check_motion(motion, layout, self.things)
        first = {} if motion is None else {n: rows[0] for n, rows in motion.qpos.items()}
        self.start: dict[str, Floats] = {
            name: np.array((start or first).get(name, placement.start_qpos), float)
            for name, placement in layout.items()
        }

    def link_poses(self, name: str, qpos: Floats) -> Floats:
        """Return the poses of a robot's links in the frame of its base, (links, 4, 4).

        Args:
            name: The robot.
            qpos: Joint positions in the descriptor's order, (dof,) (rad, m).
        """
        return self.models[name].kinematics.forward(np.array([qpos]))[0]

    def contacts(self, qpos: Mapping[str, Floats]) -> list[LinkContact]:
        """Return where robots overlap, with each other or with themselves, the deepest first.

        Args:
            qpos: By robot, joint positions in the descriptor's order, (dof,) (rad, m).
        """
        standing = {
            name: stand(name, placement.base_pose, self.models[name], np.array([qpos[name]]))
            for name, placement in self.layout.items()
        }
        deepest: dict[tuple[tuple[str, str], tuple[str, str]], float] = {}
        for one, other in (*((n, n) for n in standing), *combinations(standing, 2)):
            pairs = self.models[one].self_pairs if one == other else None
            for approach in touching(standing[one], standing[other], pairs):
                deepest.setdefault(((one, other), approach.links), -approach.distance)
        found = [LinkContact(robots, links, depth) for (robots, links), depth in deepest.items()]
        return sorted(found, key=lambda contact: -contact.depth)


def _check_motion(motion: ShownMotion, layout: Layout, things: Mapping[str, Thing]) -> None:
    if set(motion.qpos) != set(layout):
        raise LayoutError(
            f"the motion is of the robots {', '.join(motion.qpos)}; the layout has"
            f" {', '.join(layout)}"
        )
    unknown = sorted(set(motion.poses) - set(things))
    if unknown:
        raise LayoutError(f"the motion moves {', '.join(unknown)}, which are not in the cell")
    lengths = {len(rows) for rows in (*motion.qpos.values(), *motion.poses.values())}
    if len(lengths) != 1 or lengths == {0}:
        raise LayoutError(f"a motion has one number of moments, 1 or more; found {lengths}")


def printable(text: str) -> str:
    r"""Return a text as one line, with escapes such as ``\n`` for what cannot be printed."""
    return commands.printable(text).replace("\n", r"\n")


def as_html(text: str) -> str:
    """Return HTML that shows a text, line by line."""
    return "<br>".join(html.escape(printable(line)) for line in text.split("\n"))


def node(*names: str) -> str:
    """Return the path of a node in the scene's tree; a slash in a name begins no other node."""
    return "".join(f"/{''.join(map(_in_a_node, name))}" for name in names)


def _in_a_node(letter: str) -> str:
    plain = letter.isprintable() and letter not in "/%"
    return letter if plain else quote(letter, safe="", errors="surrogatepass")


class Text:
    """A text on a page's panel.

    viser's own Markdown takes HTML, and turns addresses in it into links; all text of a page is
    this instead.
    """

    def __init__(self, gui: Any, text: str, *, bold: bool = False) -> None:
        """Add it to the panel.

        Args:
            gui: The ``gui`` of a viser server.
            text: What to show, as lines.
            bold: Whether to write it in bold letters.
        """
        self._weight = "bold" if bold else "normal"
        self._handle: Any = gui.add_html("")
        self.text = text

    @property
    def text(self) -> str:
        """What is shown, as lines."""
        return self._text

    @text.setter
    def text(self, text: str) -> None:
        self._text = text
        style = f"{STYLE}; font-weight: {self._weight}"
        self._handle.content = f'<div style="{style}">{as_html(text)}</div>'
