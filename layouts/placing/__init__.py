"""Where robots best stand: a search for base poses from which they reach what they must."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from layouts.frames import Frame
from layouts.layout import Layout
from layouts.placement import Placement, RobotLike, load_robots
from robot_layouts.core.bounds import checked_number, checked_whole
from robot_layouts.core.importing import optional
from robot_layouts.core.progress import Progress
from robots import LayoutError

__all__ = ["ReachedBy", "search"]

Around = Mapping[str, Frame] | Frame | Sequence[float]
ReachedBy = str | Mapping[str, str | Sequence[str]]


def search(
    robots: Mapping[str, RobotLike],
    targets: Mapping[str, Sequence[float]] | Sequence[Sequence[float]] = (),
    *,
    around: Around | None = None,
    within: tuple[float, float, float, float] | None = None,
    heights: float | Mapping[str, float] = 0.0,
    reached_by: ReachedBy = "any",
    keyframe: str | None = None,
    clearance: float = 0.1,
    partial: bool = False,
    seed: int = 0,
    tries: int = 4,
    patience: float = 300.0,
) -> Layout:
    """Look for places from which robots reach targets, clear of each other, and share most space.

    A target counts as reached as in `Layout.validate`: without touching anything, the others at
    their keyframes. Of all places that meet this, those are best that share most workspace
    and leave most clearance, at the keyframes and where targets are reached, up to a third of the
    smaller reach. The layout that is returned has passed `Layout.validate`. The same arguments
    give the same layout. Needs the robots' files; takes seconds to a minute, and tells on stderr
    how far it is.

    Args:
        robots: Robot by name, in action order.
        targets: What must be reached, by name or in order: x, y, z of a tool centre point in the
            world (m), or these and the wxyz quaternion of the TCP link.
        around: Where bases may stand. Frames as from ``table(1.2, 0.8)`` put them along the edges
            of the table; other frames, such as ``{"roof": ceiling(1.8)}``, anywhere in their x-y
            plane; each robot takes whichever frame suits. x_min, y_min, x_max, y_max (m) is an
            area on the ground that bases keep out of, by 0.1 m. None is the ground at z = 0,
            wherever targets are in reach.
        within: Rectangle that all bases stand in, as x_min, y_min, x_max, y_max (m): in the world,
            or in the frames of ``around`` that are no tables.
        heights: Of the bases above what they stand on (m), for all, or by name.
        reached_by: Who must reach a target: ``"any"`` robot or limb, ``"all"`` of them, one of
            them by its name, or each of several; or a mapping from targets to these, ``"any"``
            for targets that are left out.
        keyframe: Keyframe every robot starts from; None is each one's home.
        clearance: Least distance between robots (m), at the keyframes with joint noise, and of a
            robot that reaches a target to the others at their keyframes.
        partial: Whether to return the best places where not all targets can be reached, instead
            of raising.
        seed: Of what is random in the search.
        tries: How many of the best places on a grid to refine by small steps; more take longer
            and find better ones.
        patience: After how long to give up (s). It never changes the layout that is returned.

    Raises:
        LayoutError: If an argument is invalid; if some target is out of every robot's reach,
            wherever it stands (the message says by how much); if no places were found from which
            all are reached; or after ``patience``.
        UnknownNameError: If a robot, keyframe, target or limb of that name does not exist.
        AssetError: If a robot's files cannot be found or are invalid.
        MissingPackageError: If python-fcl or scipy is not installed.
    """
    optional("scipy", "a search for places needs scipy and python-fcl", "checks")
    from layouts.placing.bases import ground_of
    from layouts.placing.cost import requirements_of
    from layouts.placing.refinement import centred, expect_sound, find_layout
    from layouts.placing.scene import SearchScene
    from layouts.validation.check import named_targets

    loaded = load_robots(robots, "a search")
    seed = checked_whole("seed", seed, 0, None, LayoutError)
    tries = checked_whole("tries", tries, 1, None, LayoutError)
    clearance = checked_number("clearance", clearance, 0.0, 10.0, LayoutError, "m")
    patience = checked_number("patience", patience, 0.0, 1e9, LayoutError, "s")
    named = named_targets(targets)
    alone = Layout({name: Placement(robot, keyframe=keyframe) for name, robot in loaded.items()})
    requirements = requirements_of(named, reached_by, alone)
    ground = ground_of(around, within, heights, loaded, list(named.values()))
    expect_sound(loaded, keyframe)

    def late(what: str) -> LayoutError:
        return LayoutError(
            f"no layout after {patience:g} s, while looking for places: {what}; raise patience,"
            " lower tries, or ask for less"
        )

    progress = Progress(work="looking for places", seconds=patience, late=late)
    scene = SearchScene(loaded, keyframe, ground)
    layout = find_layout(
        scene, requirements, clearance, progress, partial=partial, seed=seed, tries=tries
    )
    return layout if named or around is not None or within is not None else centred(layout)
