"""``robot-layouts layouts``: shows, validates, searches, views or exports a layout."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from layouts import frames, placing
from layouts.layout import Layout
from layouts.maniskill import TASKS, from_maniskill
from layouts.presets import FACING, PRESETS
from robot_layouts.core.bounds import shown
from robot_layouts.core.cli import Corners, File, Word, by_name
from robot_layouts.core.commands import LOOPBACK, UsageError
from robots import LayoutError, UnknownNameError
from robots.named import FORMS, named_robot

if TYPE_CHECKING:
    from layouts.viewer import ShownCell

FORMATS: dict[str, Callable[..., Path]] = {
    "mjcf": Layout.to_mjcf,
    "usd": Layout.to_usd,
    "ros2": Layout.to_ros2,
    "urdf": Layout.to_urdf,
    "drake": Layout.to_drake,
}


def _distance(word: str) -> float | str:
    try:
        return word if word == "auto" else float(word)
    except ValueError:
        raise LayoutError(f"{word!r} is no distance; it takes a number (m) or auto") from None


NamedRobot = Annotated[str, Word("NAME=ROBOT", about=FORMS)]
Distance = Annotated[float | str, Word("M|auto", _distance)]
Target = Annotated[Sequence[str], Word("[NAME=]X,Y,Z", action="append")]


@dataclass(frozen=True, kw_only=True)
class LayoutWords:
    """Which layout a command is about.

    Attributes:
        what: A layout's file (.yaml), or the id of one of ManiSkill's tasks, or a preset.
        robots: Robots of a preset in action order, or other robots for some places of a layout.
        spacing: Distance between neighbouring bases (m).
        radius: Distance of the bases from the middle (m).
        inset: Distance of the bases from the table's edge (m).
        facing: Which way robots of a ring face.
        columns: Robots in a row of a grid.
        edges: Edge of each robot.
        table: Size of the table along x and y (m).
        keyframe: Keyframe with the joint positions to start from.
    """

    what: Annotated[str, Word("WHAT", about=", ".join(PRESETS))] = field(kw_only=False)
    robots: Sequence[NamedRobot] = field(default=(), kw_only=False)
    spacing: Distance | None = None
    radius: Distance | None = None
    inset: Distance | None = None
    facing: Annotated[str, Word("WAY", about=", ".join(FACING))] | None = None
    columns: int | None = None
    edges: (
        Annotated[
            tuple[str, ...],
            Word("EDGE,…", lambda word: tuple(word.split(",")), about=", ".join(frames.EDGES)),
        ]
        | None
    ) = None
    table: Annotated[tuple[float, float], Word(("WIDTH", "DEPTH"))] | None = None
    keyframe: Annotated[str, Word("NAME")] | None = None

    def layout(self) -> Layout:
        """Return the layout.

        Raises:
            RobotLayoutsError: If there is no such layout.
        """
        given = {
            name: value
            for name, value in vars(self).items()
            if name not in ("what", "robots") and value is not None
        }
        if self.what in PRESETS:
            return _build(self.what, self.robots, given)
        if Path(self.what).suffix.lower() in (".yaml", ".yml"):
            read = Layout.load
        elif self.what in TASKS:
            read = from_maniskill
        else:
            raise UnknownNameError(
                "layout preset", self.what, [*PRESETS, *TASKS], "Or give a file ending in .yaml."
            )
        if given:
            words = " ".join(f"--{name}" for name in given)
            raise LayoutError(f"{self.what} says where robots stand; it takes no {words}")
        robots = {name: named_robot(word) for name, word in _named_robots(self.robots).items()}
        return read(self.what).replace_robots(**robots)  # which may be those that it cannot name


def _build(preset: str, robots: Sequence[str], options: Mapping[str, Any]) -> Layout:
    """Build the layout of a preset.

    Raises:
        UnknownNameError: If there is no such robot or keyframe.
        LayoutError: If a word is malformed, or the preset lacks or does not take an option.
    """
    place = PRESETS[preset]
    parameters = dict(inspect.signature(place).parameters)
    del parameters["robots"]
    for name in options:
        if name not in parameters:
            takes = ", ".join(f"--{parameter}" for parameter in parameters)
            raise LayoutError(f"{preset} takes no --{name}; it takes {takes}")
    for name, parameter in parameters.items():
        if parameter.default is parameter.empty and name not in options:
            raise LayoutError(f"{preset} needs --{name}")
    layout = place(_named_robots(robots), **options)
    if not isinstance(layout, Layout):
        raise LayoutError(f"the preset {preset} returned {shown(layout)}; a Layout is needed")
    return layout


def _named_robots(words: Sequence[str]) -> dict[str, str]:
    return by_name(words, "name=robot", "left=panda", LayoutError, "name")


@dataclass(frozen=True, kw_only=True)
class Server:
    """Where a page is served.

    Attributes:
        host: Where to listen; 127.0.0.1 is this machine alone, 0.0.0.0 the network, too.
        port: Port; 0 takes any free one.
    """

    host: Annotated[str, Word("ADDRESS")] = LOOPBACK
    port: int = 8080


@dataclass(frozen=True, kw_only=True)
class Page(Server):
    """Where a page is served or saved.

    Attributes:
        html: Save the page as one file instead, without sliders.
    """

    html: File | None = None

    def show(self, cell: Callable[[], ShownCell]) -> None:
        """Serve or save a page.

        Args:
            cell: Makes what to show; called after a look whether it can be shown.

        Raises:
            RobotLayoutsError: If the page cannot be served or saved.
        """
        from layouts.viewer.cell import printable
        from layouts.viewer.page import NO_SLIDERS, save_html, serve
        from layouts.viewer.server import import_viser

        import_viser()
        try:
            made = cell()
            for note in made.notes:
                print(note, flush=True)
            if self.html is None:
                serve(made, self.host, self.port, lambda line: print(line, flush=True))
            else:
                print(f"page: {printable(str(save_html(made, self.html)))}\n{NO_SLIDERS}")
        except KeyboardInterrupt:
            print("ended")


def show(layout: LayoutWords, *, save: File | None = None, preview: File | None = None) -> None:
    """Print a layout as a table, and draw it if asked.

    Args:
        layout: The layout.
        save: Write the layout as YAML.
        preview: Save a top view (.png, .pdf or .svg).

    Raises:
        RobotLayoutsError: If there is no such layout, or a file cannot be written.
    """
    chosen = layout.layout()
    print(chosen)
    if save is not None:
        print(f"layout: {chosen.save(save)}")
    if preview is not None:
        print(f"picture: {chosen.preview(preview)}")


def validate(
    layout: LayoutWords,
    *,
    target: Target = (),
    tabletop: Corners | None = None,
    samples: int = 20,
    seed: int = 0,
    picture: File | None = None,
) -> int:
    """Check a layout for collisions and reach.

    Exit code: 0 if the layout is ok, 1 if not, 2 for bad usage.

    Args:
        layout: The layout.
        target: A place that some robot must reach (m); with four more numbers, the wxyz orientation
            of its TCP; may be given several times.
        tabletop: Outline of a table with its top at z = 0 (m).
        samples: Number of draws of joint noise.
        seed: Seed of the joint noise.
        picture: Save a view (.png, .pdf or .svg).

    Raises:
        RobotLayoutsError: If there is no such layout, or an option is invalid.
    """
    report = layout.layout().validate(
        targets=_targets(target), samples=samples, table=tabletop, seed=seed
    )
    print(report)
    if picture is not None:
        print(f"picture: {report.picture(picture)}")
    return 0 if report.ok else 1


def search(
    robots: Sequence[NamedRobot],
    *,
    target: Target = (),
    reached_by: Annotated[Sequence[str], Word("[TARGET=]WHO", action="append")] = (),
    table: Annotated[tuple[float, float], Word(("WIDTH", "DEPTH"))] | None = None,
    around: Corners | None = None,
    ceiling: Annotated[float, Word("M")] | None = None,
    within: Corners | None = None,
    height: Annotated[float, Word("M")] = 0.0,
    keyframe: Annotated[str, Word("NAME")] | None = None,
    clearance: Annotated[float, Word("M")] | None = None,
    partial: bool = False,
    seed: int = 0,
    tries: int | None = None,
    patience: Annotated[float, Word("S")] | None = None,
    out: File | None = None,
    picture: File | None = None,
) -> int:
    """Look for places from which robots reach targets.

    Exit code: 0 if all targets are reached, 1 if not, 2 for bad usage.

    Args:
        robots: Robots in action order.
        target: A place that some robot must reach (m); with four more numbers, the wxyz orientation
            of its TCP; may be given several times.
        reached_by: Any (which it is by default), all, or names of robots or limbs, joined by
            commas, each of which must reach it; without TARGET, for all that are not named.
        table: Stand the bases along the edges of a table about the origin (m along x and y).
        around: Stand the bases on the ground around an area (m).
        ceiling: Hang the bases at this height (m).
        within: Area that bases stand in (m).
        height: Height of the bases above the ground.
        keyframe: Keyframe with the joint positions to start from.
        clearance: Least distance between robots (m).
        partial: Leave out targets that cannot be reached.
        seed: Seed of the search.
        tries: Number of placements to begin from; more take longer.
        patience: Time limit (s).
        out: Write the layout as YAML.
        picture: Save a view (.png, .pdf or .svg).

    Raises:
        RobotLayoutsError: If an option is invalid, or no placement is found.
    """
    if sum(where is not None for where in (table, around, ceiling)) > 1:
        raise UsageError("--table, --around and --ceiling exclude each other; choose one of them")
    where: Any = around
    if table is not None:
        where = frames.table(*table)
    if ceiling is not None:
        where = {"ceiling": frames.ceiling(ceiling)}
    limits = {"clearance": clearance, "tries": tries, "patience": patience}
    given: dict[str, Any] = {name: value for name, value in limits.items() if value is not None}
    targets = _targets(target)
    layout = placing.search(
        _named_robots(robots),
        targets,
        around=where,
        within=within,
        heights=height,
        reached_by=_reached_by(reached_by, targets),
        keyframe=keyframe,
        partial=partial,
        seed=seed,
        **given,
    )
    print(layout)
    report = layout.validate(targets=targets)
    print(report)
    if out is not None:
        print(f"layout: {layout.save(out)}")
    if picture is not None:
        print(f"picture: {report.picture(picture)}")
    return 0 if report.ok else 1


def view(layout: LayoutWords, *, page: Page) -> None:
    """Look at a layout in a browser, and move its joints.

    Args:
        layout: The layout.
        page: Where it is served or saved.

    Raises:
        RobotLayoutsError: If there is no such layout, or it cannot be served or saved.
    """
    from layouts.viewer import ShownCell

    chosen = layout.layout()
    page.show(lambda: ShownCell(" ".join([layout.what, *layout.robots]), chosen))


def export(
    layout: LayoutWords,
    *,
    format: Annotated[str, Word(choices=FORMATS)],
    out: Annotated[str, Word("PATH")],
    visuals: bool = True,
) -> None:
    """Write a layout for MuJoCo, USD, ROS 2, Drake, or as one URDF.

    Args:
        layout: The layout.
        format: A model for MuJoCo (.xml), a USD stage (.usd, .usda, .usdc), a ROS 2 package with
            MoveIt's configuration (a folder), one URDF (.urdf), or Drake's model directives
            (.dmd.yaml).
        out: Where to write it.
        visuals: Leave out what the robots look like, and fetch only what physics needs.

    Raises:
        RobotLayoutsError: If there is no such layout, or it cannot be written.
    """
    print(f"{format}: {FORMATS[format](layout.layout(), out, visuals=visuals)}")


def _targets(words: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Return targets by name from the words of ``--target``.

    Raises:
        LayoutError: If a word is malformed, or a name is given twice.
    """
    targets: dict[str, tuple[float, ...]] = {}
    for number, word in enumerate(words, start=1):
        name, _, place = word.rpartition("=")
        name = name or f"target {number}"
        if name in targets:
            raise LayoutError(f"target {name!r} is given twice; each needs its own name")
        try:
            targets[name] = tuple(float(x) for x in place.split(","))
        except ValueError:
            raise LayoutError(
                f"{word!r} should be name=x,y,z in metres, for example cube=0.4,0,0.1"
            ) from None
    return targets


def _reached_by(words: Sequence[str], targets: Iterable[str]) -> placing.ReachedBy:
    """Return what `layouts.search` takes, from the words of ``--reached-by``.

    Raises:
        LayoutError: If a target, or what holds for all others, is given twice.
    """
    given: dict[str, str | list[str]] = {}
    for word in words:
        name, _, who = word.rpartition("=")
        if name in given:
            what = f"target {name!r}" if name else "all targets"
            raise LayoutError(f"--reached-by says twice who reaches {what}; say it once")
        given[name] = who.split(",") if "," in who else who
    others = given.pop("", "any")
    return {**dict.fromkeys(targets, others), **given}
