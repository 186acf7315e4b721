"""Pictures of motions: from above, with ways, postures, distances and speeds; still or moving."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import count
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from layouts.preview import TABLE, decimal
from layouts.validation.findings import length_text
from robot_layouts.core.errors import MotionError
from robot_layouts.core.figures import COLOURS, FAINT, INK, SUPPORTED, blank_figure
from robot_layouts.core.importing import optional
from robot_layouts.core.progress import Progress
from robot_layouts.core.writing import written_whole
from robot_layouts.kinematics.quaternions import forward
from robot_layouts.kinematics.rotations import Floats, transform
from robot_layouts.motion.model.bodies import CellSolid
from robot_layouts.motion.output.scenes import Scenes
from robot_layouts.motion.timed_motion import TimedMotion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOVING = (".webp", ".gif")

WIDTH = 8.0  # inches; 1200 pixels
LEFT, RIGHT, ABOVE = 0.75, 0.25, 0.5  # around the plan (inches)
PLAN_HEIGHTS = (4.0, 7.5)  # smallest and largest height of the plan (inches)
STRIP, BETWEEN, BELOW = 0.95, 0.32, 0.55  # height of each strip, and the room around them (inches)
OBSTACLE = "#BDBDBD"
LIMIT: dict[str, Any] = {"color": "#B2182B", "linewidth": 1.0, "linestyle": "--"}
MARGIN = 0.05  # free space around all that is drawn, in shares of the plan's larger side
SAMPLES = 81  # moments of the strips
SMOOTH = 241  # moments of a way
MOST_MARKS = 10  # on a way, besides its ends
FRAMES = 20  # per second, of a moving picture
REST = 1.0  # s, for which a moving picture shows its end
MOVING_DOTS = 75  # per inch, of a moving picture

Drawn = Callable[[int, int], None]  # pictures that are drawn, and that of all


def save_picture(
    motion: TimedMotion, path: str | PathLike[str], progress: Drawn | None = None
) -> Path:
    """Save a picture, whole or not at all; see `robot_layouts.motion.Motion.picture`.

    Args:
        motion: What to draw.
        path: Where.
        progress: Called with the number of pictures that are drawn, and that of all; by default
            stderr says how far it is.
    """
    target = Path(path)
    kind = target.suffix.lower()
    if kind in SUPPORTED:
        figure = _Picture(motion).still()
        with written_whole(target) as unfinished:
            figure.savefig(unfinished, format=kind[1:])
    elif kind in MOVING:
        with Progress(unit="pictures") as line:
            drawn = progress or (lambda done, total: line.update(done, "drawing", total))
            frames = _Picture(motion, MOVING_DOTS).frames(drawn)
        with written_whole(target) as unfinished:
            _write_frames(frames, unfinished, kind[1:])
    else:
        endings = ", ".join((*SUPPORTED, *MOVING))
        raise MotionError(
            f"cannot save a picture as {target.name!r}; the name must end in one of {endings}"
        )
    return target


class _Picture:
    """A motion on a figure: a plan, and below it what happens over time."""

    def __init__(self, motion: TimedMotion, dots_per_inch: int = 150) -> None:
        self._motion, self._scenes = motion, Scenes(motion)
        self._bodies = {time: self._scenes.moving(time) for time in (0.0, motion.duration)}
        self._ways = self._scenes.tcp_ways(np.linspace(0, motion.duration, SMOOTH))
        low, high = self._bounds()
        plan_width = WIDTH - LEFT - RIGHT
        height = plan_width * (high[1] - low[1]) / (high[0] - low[0])
        height = min(max(height, PLAN_HEIGHTS[0]), PLAN_HEIGHTS[1])
        under = BELOW + 2 * STRIP + BETWEEN + 0.75
        whole = ABOVE + height + under
        self._figure = blank_figure("a picture of a motion", (WIDTH, whole), dots_per_inch)
        place = (LEFT / WIDTH, under / whole, plan_width / WIDTH, height / whole)
        self._plan = self._figure.add_axes(place)
        middle, half = (low + high) / 2, (high - low) / 2
        half = np.maximum(half, half[::-1] * (plan_width / height, height / plan_width))
        self._plan.set_xlim(middle[0] - half[0], middle[0] + half[0])
        self._plan.set_ylim(middle[1] - half[1], middle[1] + half[1])
        self._over: list[Any] = []  # what is drawn over robots that move
        self._strips: list[Axes] = []
        for row in (1, 0):
            bottom = BELOW + row * (STRIP + BETWEEN)
            box = (LEFT / WIDTH, bottom / whole, plan_width / WIDTH, STRIP / whole)
            self._strips.append(self._figure.add_axes(box))
        self._draw_around()

    def still(self) -> Figure:
        """Return the figure with the robots where they end."""
        self._draw_bodies(self._bodies[self._motion.duration], 0.5, 3.0, edges=True)
        return self._figure

    def frames(self, progress: Drawn) -> list[Any]:
        """Return the figure at many moments, as arrays (height, width, 3) of uint8."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        canvas = FigureCanvasAgg(self._figure)
        canvas.draw()
        empty = canvas.copy_from_bbox(self._figure.bbox)
        moments = np.linspace(
            0, self._motion.duration, max(2, round(self._motion.duration * FRAMES) + 1)
        )
        pictures: list[Any] = []
        for done, time in enumerate(moments.tolist(), start=1):
            canvas.restore_region(empty)
            drawn = [self._draw_bodies(self._scenes.moving(time), 0.5, 3.0, edges=True)]
            lines = [strip.axvline(time, color=INK, linewidth=1.2) for strip in self._strips]
            for artist in (*drawn, *self._over, *lines):
                artist.draw(canvas.get_renderer())
            for artist in (*drawn, *lines):
                artist.remove()
            pictures.append(np.asarray(canvas.buffer_rgba())[..., :3].copy())
            progress(done, len(moments))
        return pictures

    # -- the plan ----------------------------------------------------------------------------

    def _bounds(self) -> tuple[Floats, Floats]:
        """Return the least and greatest corner of everything that robots do, (2,) (m)."""
        points = [corners[:, :2] for bodies in self._bodies.values() for _, corners in bodies]
        points += [
            transform(solid.offset, solid.hull.corners)[:, :2]
            for solid in self._scenes.standing()
            if solid.owner not in self._scenes.cell.tables
        ]
        points += [way[:, :2] for way in self._ways.values()]
        every = np.concatenate(points)
        low, high = every.min(axis=0), every.max(axis=0)
        margin = MARGIN * float((high - low).max())
        return low - margin - 0.05, high + margin + 0.05

    def _draw_around(self) -> None:
        """Draw what does not move, and what is over the robots: ways, marks and names."""
        plan, motion = self._plan, self._motion
        standing = [
            (solid, transform(solid.offset, solid.hull.corners))
            for solid in self._scenes.standing()
        ]
        self._draw_bodies(standing, 0.0, 1.0, edges=True)
        self._draw_bodies(self._bodies[0.0], 0.84, 2.0, edges=False)
        for arm, way in self._ways.items():
            self._draw_way(way, self._colour(arm))
        for name in motion.layout:
            self._write_name(name)
        count = len(motion.layout)
        title = f"Motion of {decimal(count)} robot{'s' * (count != 1)}"
        plan.set_title(title, loc="left", color=INK, fontsize=13, weight="bold")
        plan.set_title(f"{motion.duration:.2f} s", loc="right", color=INK, fontsize=13)
        plan.set_xlabel("x (m)", color=INK, loc="left")
        self._write_legend()
        plan.set_ylabel("y (m)", color=INK)
        plan.set_aspect("equal")
        plan.grid(color="#DDDDDD", linewidth=0.6)
        plan.set_axisbelow(True)
        _plain(plan)
        self._draw_distances(self._strips[0])
        self._draw_speeds(self._strips[1])

    def _draw_bodies(
        self, bodies: Sequence[tuple[CellSolid, Floats]], white: float, level: float, *, edges: bool
    ) -> Any:
        """Draw outlines from above, the highest last.

        Args:
            bodies: With their corners (m, world).
            white: How much white is in robots' colours.
            level: Over what else is drawn.
            edges: Whether their edges are drawn.
        """
        from matplotlib.collections import PolyCollection

        ordered = sorted(bodies, key=lambda body: float(body[1][:, 2].max()))
        inks = [self._ink(solid, white) for solid, _ in ordered]
        drawn = PolyCollection(
            [_outline(corners[:, :2]) for _, corners in ordered],
            facecolors=[face for face, _ in inks],
            edgecolors=[edge if edges else face for face, edge in inks],
            linewidths=0.7,
            zorder=level,
        )
        return self._plan.add_collection(drawn, autolim=False)

    def _ink(self, solid: CellSolid, white: float) -> tuple[Any, Any]:
        """Return the colour of a body, and that of its edge."""
        if solid.mover:
            colour = self._colour(solid.mover)
            return _mixed(colour if solid.owner == solid.mover else INK, white), colour
        return (TABLE, "#C9B99B") if solid.owner in self._scenes.cell.tables else (OBSTACLE, FAINT)

    def _draw_way(self, way: Floats, colour: str) -> None:
        """Draw the way of a TCP, with dots at round times."""
        plan = self._plan
        if np.ptp(way, axis=0).max() < 1e-3:
            return
        for width, ink in ((5.5, "white"), (2.6, colour)):
            self._over += plan.plot(
                *way.T[:2], color=ink, linewidth=width, zorder=6, solid_capstyle="round"
            )
        times = np.linspace(0, self._motion.duration, len(way))
        marks = np.array(_marks(self._motion.duration))
        dots = np.stack([np.interp(marks, times, way[:, i]) for i in (0, 1)])
        white: dict[str, Any] = {"markeredgecolor": "white", "linestyle": "none"}
        self._over += [
            *plan.plot(*dots, "o", color="white", markeredgecolor=colour, markersize=5.5, zorder=7),
            *plan.plot(*way[0, :2], marker="o", color=colour, markersize=9, zorder=7, **white),
            *plan.plot(*way[-1, :2], marker="*", color=colour, markersize=17, zorder=8, **white),
        ]

    def _write_name(self, name: str) -> None:
        """Write a robot's name behind its back, where its arm is least."""
        from matplotlib.patheffects import withStroke

        base = np.array(self._motion.layout[name].base_position[:2])
        ahead = np.array(forward(self._motion.layout[name].facing)[:2])
        length = float(np.linalg.norm(ahead))
        behind = -ahead / length if length > 0.1 else np.array([0.0, -1.0])
        bodies = [c[:, :2] - base for solid, c in self._bodies[0.0] if solid.owner == name]
        place = base + behind * max(0.0, float((np.concatenate(bodies) @ behind).max()))
        x, y = behind.tolist()
        self._over.append(
            self._plan.annotate(
                name,
                xy=place.tolist(),
                xytext=(6 * x, 6 * y),
                textcoords="offset points",
                color=self._colour(name),
                fontsize=12,
                fontweight="bold",
                ha="right" if x < -0.5 else "left" if x > 0.5 else "center",
                va="top" if y < -0.5 else "bottom" if y > 0.5 else "center",
                path_effects=[withStroke(linewidth=3.5, foreground="white")],
                zorder=9,
            )
        )

    def _write_legend(self) -> None:
        """Say what the marks mean, below the plan."""
        marks = _marks(self._motion.duration)
        text = (
            f"pale, ●: start    full, ★: end    lines: tool centre points, ○ every {marks[0]:g} s"
        )
        self._plan.text(
            1.0, -0.055, text, transform=self._plan.transAxes, color=FAINT, fontsize=9,
            ha="right", va="top",
        )  # fmt: skip

    def _colour(self, arm: str) -> str:
        owner = self._motion.layout.owner(arm)
        return COLOURS[list(self._motion.layout).index(owner) % len(COLOURS)]

    # -- what happens over time --------------------------------------------------------------

    def _draw_distances(self, strip: Axes) -> None:
        times = np.linspace(0, self._motion.duration, SAMPLES)
        distances, nearest = self._scenes.distances(times)
        self._begin_strip(strip, "distance (cm)")
        if not nearest:
            strip.text(
                0.5, 0.5, "nothing is near", transform=strip.transAxes, color=FAINT, ha="center"
            )
            strip.set_yticks([])
            return
        centimetres = 100 * distances
        least = int(np.nanargmin(centimetres))
        strip.plot(times, centimetres, color=INK, linewidth=1.8)
        strip.plot(times[least], centimetres[least], "o", color=INK, markersize=5)
        strip.set_ylim(min(0.0, 1.1 * centimetres[least]), 1.15 * float(np.nanmax(centimetres)))
        if self._motion.clearance:
            asked = 100 * self._motion.clearance
            strip.axhline(asked, **LIMIT)
            strip.annotate(
                "asked for", (self._motion.duration, asked), (-3, 2), textcoords="offset points",
                color=LIMIT["color"], fontsize=7.5, ha="right",
            )  # fmt: skip
        one, other = (name.replace("/", "'s ") for name in nearest)
        near = distances[least]
        text = f"{'least' if near >= 0 else 'overlap'}: {length_text(abs(near))}, {one} and {other}"
        ink = INK if near >= 0 else LIMIT["color"]
        strip.set_title(text, loc="right", color=ink, fontsize=9, pad=3)
        strip.set_title("what is nearest", loc="left", color=FAINT, fontsize=9, pad=3)
        strip.tick_params(labelbottom=False)

    def _draw_speeds(self, strip: Axes) -> None:
        times = np.linspace(0, self._motion.duration, SMOOTH)
        self._begin_strip(strip, "speed (%)")
        for name, shares in self._scenes.speeds(times).items():
            strip.plot(times, 100 * shares, color=self._colour(name), linewidth=1.8)
        strip.axhline(100, **LIMIT)
        strip.set_ylim(0, 112)
        strip.set_yticks([0, 50, 100])
        strip.set_title(
            "fastest joint of each robot, of its limit", loc="left", color=FAINT, fontsize=9, pad=3
        )
        strip.set_xlabel("time (s)", color=INK)

    def _begin_strip(self, strip: Axes, what: str) -> None:
        strip.set_xlim(0, self._motion.duration)
        strip.set_xticks([0.0, *_marks(self._motion.duration)])
        strip.set_ylabel(what, color=INK, fontsize=9)
        strip.grid(color="#DDDDDD", linewidth=0.6)
        _plain(strip)


def _write_frames(frames: Sequence[Any], path: Path, kind: str) -> None:
    Image = optional("PIL.Image", "a moving picture needs pillow", "view")
    first, *others = [Image.fromarray(frame) for frame in frames]
    milliseconds = [1000 // FRAMES] * len(others) + [int(1000 * REST)]
    settings: dict[str, Any] = {"quality": 80, "method": 4} if kind == "webp" else {}
    first.save(
        path, kind.upper(), save_all=True, append_images=others, duration=milliseconds, loop=0,
        **settings,
    )  # fmt: skip


def _marks(duration: float) -> list[float]:
    """Return round times within a duration, few enough to be read."""
    steps = (nice * 10.0**power for power in count(-3) for nice in (1, 2, 5))
    step = next(step for step in steps if duration / step <= MOST_MARKS)
    return [round(i * step, 6) for i in range(1, int(duration / step + 1e-9) + 1)]


def _outline(points: Floats) -> Floats:
    """Return the corners of the convex hull of points in the plane, in order, (n, 2)."""
    from scipy.spatial import ConvexHull

    return points[ConvexHull(points).vertices]


def _mixed(colour: str, white: float) -> tuple[float, ...]:
    """Return a colour with a share of white in it."""
    rgb = np.array(list(bytes.fromhex(colour.removeprefix("#")))) / 255
    return tuple((rgb + white * (1 - rgb)).tolist())


def _plain(axes: Axes) -> None:
    axes.tick_params(colors=INK, labelsize=9, length=0)
    for spine in axes.spines.values():
        spine.set_color("#BBBBBB")
