"""A robot as a picture: its limbs at rest, its front, its tool centre points, its gripper at work.

Drawn from the collision shapes, so that neither a graphics driver nor the meshes that are only
for pictures are needed.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from robot_layouts.core.errors import DescriptorError
from robot_layouts.core.figures import COLOURS, FAINT, INK, blank_figure, save_figure
from robot_layouts.core.quoting import cut
from robot_layouts.kinematics.rotations import Floats
from robots.action_split import is_gripper
from robots.bodies.hulls import RobotModel, load_model
from robots.descriptor import RobotDescriptor
from robots.gripper_motion import ends_of
from robots.urdf.tcp import find_tcp

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, PICTURE_HEIGHT = 11.0, 6.2  # inches, without the words
WHOLE = 0.62  # of the width is for the robot, the rest for its grippers
LINE_HEIGHT = 0.24  # of the words (inches)
MARGIN = 0.02  # in widths, as the next
TABLE_COLUMNS, LETTERS = (MARGIN, 0.15, 0.68), (22, 80, 46)  # of the words: where, and how many
HANDS = 2  # limbs whose grippers are shown
GRIPPER = ("open", "closed")
EYE = np.array([1.0, -0.75, 0.55])  # from where the robot is seen, in its own frame
LIGHT = np.array([0.3, -0.5, 0.8])
SHADE = 0.45  # how dark what faces away from the light is
BODY, FINGER = "#B9BEC4", "#E69F00"  # links of no limb, and links that grasp
AXES = (("x", "#D62728"), ("y", "#2CA02C"), ("z", "#1F4FD8"))
AXIS_LENGTH, ARROW = 0.14, 0.75  # of the TCP's axes and of the front's arrow, in sizes of the robot
STILL = 1e-4  # m: a gripper that moves less does not open


@dataclass(frozen=True, eq=False)
class _Limb:
    """What is drawn of a limb, or of a robot that is one arm."""

    name: str
    part: RobotDescriptor
    colour: str


def save_picture(
    robot: RobotDescriptor, path: str | os.PathLike[str], notes: Sequence[str] = ()
) -> Path:
    """Draw a robot and save the picture, whole or not at all.

    It shows the robot at rest with each limb in its colour, an arrow to its front, the axes of each
    tool centre point (x red, y green, z blue), and its gripper, open and closed, with the links
    that grasp. Beneath stand what decides how it works and the field of the descriptor to change
    where that is wrong.

    Args:
        robot: What to draw.
        path: Where to save; the ending chooses the format (.png, .pdf or .svg).
        notes: Further lines to write beneath it.

    Returns:
        The path of the picture.

    Raises:
        AssetError: If its files cannot be found or are invalid.
        DescriptorError: If the ending names no supported format.
        MissingPackageError: If matplotlib or python-fcl is not installed.
    """
    return save_figure(lambda: draw(robot, notes), path, "picture", DescriptorError)


def draw(robot: RobotDescriptor, notes: Sequence[str] = ()) -> Figure:
    """Return the figure that `save_picture` saves; see there.

    Args:
        robot: What to draw.
        notes: Further lines to write beneath it.

    Raises:
        AssetError: If its files cannot be found or are invalid.
        MissingPackageError: If matplotlib or python-fcl is not installed.
    """
    model, limbs = load_model(robot), _limbs(robot)
    rows = list(_rows(robot, limbs))
    height = PICTURE_HEIGHT + LINE_HEIGHT * (len(rows) + len(notes) + 1.5)
    figure = blank_figure("the picture of a robot", (WIDTH, height))
    below, hands = 1 - PICTURE_HEIGHT / height, [limb for limb in limbs if _grips(limb.part)]
    share = WHOLE if hands else 1.0
    rest = np.array(robot.keyframe(robot.home.keyframe), float)
    _draw_robot(figure.add_axes((0.0, below, share, 1 - below)), robot, model, limbs, rest)
    panels = [(limb, at) for limb in hands[:HANDS] for at in GRIPPER]
    columns = 1 if len(panels) == len(GRIPPER) else 2
    wide, tall = (1 - share) / columns, (1 - below) / 2
    for i, (limb, at) in enumerate(panels):
        row, column = divmod(i, columns)
        place = (share + column * wide, 1 - (row + 1) * tall, wide, tall)
        _draw_hand(figure.add_axes(place), robot, model, limb, rest, at)
    figure.text(MARGIN, 1 - 0.3 / height, robot.name, size=15, weight="bold", color=INK)
    figure.text(MARGIN, 1 - 0.55 / height, robot.summary, size=10, color=FAINT)
    tops = [below - LINE_HEIGHT * (i + 1) / height for i in range(len(rows) + len(notes) + 1)]
    _write(figure, tops[0], ("", "", "if that is wrong, change"), FAINT)
    for top, row in zip(tops[1:], rows, strict=False):
        _write(figure, top, row, INK)
    for top, note in zip(tops[1 + len(rows) :], notes, strict=True):
        figure.text(MARGIN, top, cut(note, 150), size=9, color=INK)
    return figure


def _write(figure: Figure, top: float, row: Sequence[str], colour: str) -> None:
    for left, letters, text in zip(TABLE_COLUMNS, LETTERS, row, strict=True):
        figure.text(left, top, cut(text, letters), size=9, color=colour)


def _limbs(robot: RobotDescriptor) -> list[_Limb]:
    parts = {name: robot.parts[name] for name in robot.limbs} or {robot.name: robot}
    return [
        _Limb(name, part, COLOURS[i % len(COLOURS)]) for i, (name, part) in enumerate(parts.items())
    ]


def _grips(part: RobotDescriptor) -> bool:
    """Tell whether a part has a gripper that action numbers drive."""
    return any(is_gripper(name) and group.size for name, group in part.action_split.groups.items())


def _posed(robot: RobotDescriptor, model: RobotModel, limb: _Limb, rest: Floats, at: str) -> Floats:
    """Return all joints with the gripper of a limb open or closed, (dof,) (rad, m)."""
    qpos, limits = rest.copy(), model.kinematics.limits
    for name, group in limb.part.action_split.groups.items():
        if is_gripper(name):
            joints = [robot.joints.index(joint) for joint in group.joints]
            qpos[joints] = ends_of(group, limits, robot)[:, GRIPPER[::-1].index(at)]
    return qpos.clip(*limits.T)


def _draw_robot(
    axes: Axes,
    robot: RobotDescriptor,
    model: RobotModel,
    limbs: Sequence[_Limb],
    qpos: Floats,
) -> None:
    poses, every = _poses(model, qpos), range(len(model.hulls))
    view = _View(EYE)
    _draw_faces(axes, view, model, poses, _colours(model, limbs), every)
    points = np.concatenate([_points(model, poses, every), poses[:, :3, 3]])
    if not model.hulls:
        _draw_bones(axes, view, model, poses)
    size, lowest = float(np.ptp(points, axis=0).max()), points[:, 2].min()
    start, end = np.array([0.0, 0.0, lowest]), np.array([ARROW * size, 0.0, lowest])
    corners = [view.flat(points), _arrow(axes, view, start, end, INK, "front")]
    for limb in limbs:
        origin, turned = _tcp(limb.part, model, poses)
        corners.append(_draw_axes(axes, view, origin, turned, AXIS_LENGTH * size))
        label = f"TCP of {limb.name}" if len(limbs) > 1 else "TCP"
        _label(axes, view.flat(origin[None])[0], (8, 8), label, limb.colour)
    _frame(axes, np.concatenate(corners))


def _draw_hand(
    axes: Axes,
    robot: RobotDescriptor,
    model: RobotModel,
    limb: _Limb,
    rest: Floats,
    at: str,
) -> None:
    """Draw a gripper, seen so that its way of opening lies across the picture."""
    links = _gripper_links(model, limb.part)
    chosen = [i for i, hull in enumerate(model.hulls) if hull.link in links]
    poses = {at: _poses(model, _posed(robot, model, limb, rest, at)) for at in GRIPPER}
    origin, turned = _tcp(limb.part, model, poses[at])
    spread = _opening(model, *poses.values())
    eye = np.cross(spread, turned[:, 2])
    if np.linalg.norm(eye) < 0.1:  # it opens along the z axis of its TCP
        eye = np.cross(spread, turned[:, 0])
    view = _View(eye + 0.25 * turned[:, 2], up=-turned[:, 2])
    _draw_faces(axes, view, model, poses[at], _colours(model, [limb]), chosen)
    shown = np.concatenate([_points(model, posed, chosen) for posed in poses.values()])
    size = float(np.ptp(shown, axis=0).max()) if len(shown) else 0.1
    ends = _draw_axes(axes, view, origin, turned, 0.3 * size)
    _frame(axes, np.concatenate([view.flat(shown), ends]))
    name = f"{limb.name}, {at}" if robot.limbs else at
    axes.text(0.5, 0.95, name, size=9, color=limb.colour, transform=axes.transAxes, ha="center")


def _opening(model: RobotModel, opened: Floats, closed: Floats) -> Floats:
    """Return the direction in which a gripper opens, (3,), of length 1.

    Args:
        model: Whose.
        opened: Poses of its links with the gripper open, (links, 4, 4) (m).
        closed: The same with it closed.
    """
    middles = [np.array([*hull.corners.mean(axis=0), 1.0]) for hull in model.hulls]
    links = [hull.link for hull in model.hulls]
    if not middles:
        return np.array([0.0, 1.0, 0.0])
    moved = np.einsum("nij,nj->ni", (opened - closed)[links], np.array(middles))[:, :3]
    most = moved[np.linalg.norm(moved, axis=1).argmax()]
    length = float(np.linalg.norm(most))
    return most / length if length > STILL else np.array([0.0, 1.0, 0.0])


def _poses(model: RobotModel, qpos: Floats) -> Floats:
    return model.kinematics.forward(qpos[None])[0]


def _gripper_links(model: RobotModel, part: RobotDescriptor) -> set[int]:
    """Return the links that gripper joints carry, the ones these hang on, and the fingers."""
    tree, groups = model.kinematics, part.action_split.groups.items()
    names = {joint for name, group in groups if is_gripper(name) for joint in group.joints}
    moved = [i for i in _carried(model, names) if i]
    hands = {int(tree.parents[i]) for i in moved} | set(moved)
    return hands | {tree.link(link) for link in (part.fingers.links if part.fingers else ())}


def _carried(model: RobotModel, joints: Collection[str]) -> list[int]:
    """Return the links that some joints move."""
    tree = model.kinematics
    driven = {i for i, name in enumerate(tree.coordinates) if name in joints}
    return [
        i
        for i in range(len(tree.links))
        if any(int(tree.drivers[link]) in driven for link in tree.path(i))
    ]


def _tcp(part: RobotDescriptor, model: RobotModel, poses: Floats) -> tuple[Floats, Floats]:
    """Return where a TCP is, (3,) (m), and its axes as columns, (3, 3), in the robot's frame."""
    tcp = find_tcp(part, model.kinematics)
    return tcp.places(poses[None])[0], poses[tcp.turned, :3, :3]


def _colours(model: RobotModel, limbs: Sequence[_Limb]) -> list[str]:
    """Return a colour for each link."""
    colours = [BODY] * len(model.kinematics.links)
    for limb in limbs:
        for i in _carried(model, limb.part.joints):
            colours[i] = limb.colour
        for link in limb.part.fingers.links if limb.part.fingers else ():
            colours[model.kinematics.link(link)] = FINGER
    return colours


class _View:
    """Parallel projection on the plane that an eye looks at."""

    def __init__(self, eye: Floats, up: Sequence[float] | Floats = (0.0, 0.0, 1.0)) -> None:
        self.towards = np.asarray(eye, float) / np.linalg.norm(eye)
        right = np.cross(np.asarray(up, float), self.towards)
        if np.linalg.norm(right) < 1e-6:
            right = np.cross([1.0, 0.0, 0.0], self.towards)
        right /= np.linalg.norm(right)
        self.across = np.stack([right, np.cross(self.towards, right)], axis=1)

    def flat(self, points: Floats) -> Floats:
        """Return where points are seen, (n, 2) (m)."""
        return np.asarray(points @ self.across)


def _points(model: RobotModel, poses: Floats, chosen: Sequence[int]) -> Floats:
    """Return the corners of hulls in the robot's frame, (n, 3) (m)."""
    hulls = [model.hulls[i] for i in chosen]
    corners = [h.corners @ poses[h.link, :3, :3].T + poses[h.link, :3, 3] for h in hulls]
    return np.concatenate(corners) if corners else np.zeros((0, 3))


def _draw_bones(axes: Axes, view: _View, model: RobotModel, poses: Floats) -> None:
    """Draw a line from each link to the one that carries it: for robots without shapes."""
    places = view.flat(poses[:, :3, 3])
    for link, parent in enumerate(model.kinematics.parents):
        if parent >= 0:
            axes.plot(*places[[parent, link]].T, color=INK, linewidth=3, marker="o")


def _draw_faces(
    axes: Axes,
    view: _View,
    model: RobotModel,
    poses: Floats,
    colours: Sequence[str],
    chosen: Sequence[int],
) -> None:
    """Draw the faces of hulls that are seen, the farthest first."""
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgb
    from scipy.spatial import ConvexHull

    light = LIGHT / np.linalg.norm(LIGHT)
    faces: list[Floats] = []
    depths: list[Floats] = []
    paints: list[Floats] = []
    for i in chosen:
        hull = model.hulls[i]
        solid = ConvexHull(hull.corners)
        turned = poses[hull.link, :3, :3]
        corners = hull.corners @ turned.T + poses[hull.link, :3, 3]
        normals = solid.equations[:, :3] @ turned.T
        seen = normals @ view.towards > 0
        triangles = corners[solid.simplices[seen]]
        bright = 1 - SHADE * (1 - normals[seen] @ light) / 2
        faces.append(triangles)
        depths.append(triangles.mean(axis=1) @ view.towards)
        paints.append(np.outer(bright, to_rgb(colours[hull.link])))
    if not faces:
        return
    order = np.concatenate(depths).argsort()
    flat = np.concatenate(faces)[order] @ view.across
    paint = np.clip(np.concatenate(paints)[order], 0, 1)
    axes.add_collection(
        PolyCollection(list(flat), facecolors=paint, edgecolors=paint, linewidths=0.3)
    )


def _draw_axes(axes: Axes, view: _View, origin: Floats, turned: Floats, length: float) -> Floats:
    """Draw the three axes of a frame; returns what they cover, (n, 2) (m)."""
    ends = origin + length * turned.T
    start = view.flat(origin[None])[0]
    for (name, colour), end in zip(AXES, view.flat(ends), strict=True):
        axes.plot(*np.stack([start, end], axis=1), color="white", linewidth=3.6, zorder=7)
        axes.plot(*np.stack([start, end], axis=1), color=colour, linewidth=2.2, zorder=8)
        if np.linalg.norm(end - start) > 0.3 * length:
            _label(axes, end, (0, 0), name, colour)
    return np.concatenate([start[None], view.flat(ends)])


def _arrow(axes: Axes, view: _View, start: Floats, end: Floats, colour: str, label: str) -> Floats:
    """Draw an arrow and write what it is at its tip; returns what it covers, (2, 2) (m)."""
    ends = view.flat(np.stack([start, end]))
    style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6}
    axes.annotate("", tuple(ends[1]), tuple(ends[0]), arrowprops=style, zorder=6)
    _label(axes, ends[1], (4, -12), label, colour)
    return ends


def _label(axes: Axes, at: Floats, aside: tuple[float, float], text: str, colour: str) -> None:
    """Write at a point, some way aside (points)."""
    from matplotlib.patheffects import withStroke

    axes.annotate(
        text,
        tuple(at),
        aside,
        textcoords="offset points",
        color=colour,
        size=9,
        zorder=9,
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
    )


def _frame(axes: Axes, points: Floats) -> None:
    """Show all points, at one scale in both directions, and no axes."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, 0.58 * (high - low)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1], middle[1] + half[1])
    axes.set_axis_off()


def _rows(robot: RobotDescriptor, limbs: Sequence[_Limb]) -> Iterator[tuple[str, str, str]]:
    """Yield what decides how the robot works: its name, what it is, and the field to change."""
    for limb in limbs:
        part = limb.part
        of = f" of {limb.name}" if robot.limbs else ""
        inside = f"limbs[{limb.name!r}]." if robot.limbs else ""
        tcp = _listed(part.tcp_position_links) or part.tcp_link
        if len(part.tcp_position_links) > 1:
            tcp = f"the middle of {tcp}"
        offset = f" + {_metres(part.tcp_offset)} m" if any(part.tcp_offset) else ""
        fingers = _listed(part.fingers.links) if part.fingers else "not known: it cannot grasp"
        yield f"TCP{of}", tcp + offset, f"{inside}tcp_link, tcp_offset=(x, y, z)"
        yield f"fingers{of}", fingers, f"{inside}fingers=Fingers((link, link))"
        yield f"reach{of}", f"{part.reach:.2f} m", f"{inside}reach"
    keyframe = robot.home.keyframe
    yield "front", "along the arrow", "home=Home(quaternion=…)"
    yield "posture", f"keyframe {keyframe!r}", f"keyframes={{{keyframe!r}: (…)}}"


def _listed(links: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(links[:-1]), *links[-1:])))


def _metres(values: Sequence[float]) -> str:
    return f"({', '.join(f'{value:.3g}' for value in values)})"
