"""What a check of a layout found, as data."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

Point = tuple[float, ...]  # (3,) (m), world

LISTED_LINKS = 3  # pairs of links that a finding names in its text


@dataclass(frozen=True)
class LinkPair:
    """Two links that overlap.

    Attributes:
        links: Their names; the second may be a table's.
        depth: By how much at worst (m).
        point: Where, in the world (m).
    """

    links: tuple[str, str]
    depth: float
    point: Point


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a layout, or nearly.

    Attributes:
        kind: ``collision``, ``self-collision``, ``table``, ``joint limit``, ``target``,
            ``clearance`` or ``files``.
        serious: Whether it makes the layout unusable; if not, it is a warning.
        robots: Names of the robots it is about.
        links: The links that overlap, the deepest first.
        amount: How much: depth of an overlap, excess over a limit, what is missing to a target,
            or the clearance that is left (``unit``).
        unit: ``m`` or ``rad``.
        what: What was found, in a sentence.
        advice: What to change, in a sentence.
        farther: How much farther apart the two robots have to stand (m); None if that does not
            help, or it is not about two robots.
    """

    kind: str
    serious: bool
    robots: tuple[str, ...]
    links: tuple[LinkPair, ...]
    amount: float
    unit: str
    what: str
    advice: str
    farther: float | None = None

    def __str__(self) -> str:
        """Return what was found and what to change, on two lines."""
        return f"{self.kind}: {self.what}\n  {self.advice}"


@dataclass(frozen=True)
class Clearance:
    """How near two robots come, or a robot and the table.

    Attributes:
        between: Names of both robots, or of a robot and a table.
        table: Whether the second is a table.
        links: The links that come nearest at the keyframes.
        distance: Between them at the keyframes (m); negative if they overlap.
        noisy_links: The links that come nearest with joint noise.
        noisy_distance: The smallest distance with joint noise (m).
        points: The nearest points at the keyframes, world (m).
    """

    between: tuple[str, str]
    table: bool
    links: tuple[str, str]
    distance: float
    noisy_links: tuple[str, str]
    noisy_distance: float
    points: tuple[Point, Point]


@dataclass(frozen=True)
class SharedWorkspace:
    """What two robots' tool centre points both get to, collisions aside.

    Attributes:
        robots: Names of both.
        volume: Of the shared space (m³).
        shares: The same, as a share of each one's own workspace.
    """

    robots: tuple[str, str]
    volume: float
    shares: tuple[float, float]


@dataclass(frozen=True)
class TargetReach:
    """Whether a robot reaches a target.

    Attributes:
        target: Name of the target.
        robot: Name of the robot.
        reached: Whether it does, without touching itself, the table or the others at their
            keyframes.
        missing: How far its tool centre point stays from the target (m).
        turn_missing: How far its orientation stays from the target's (rad); 0 if none was asked.
        obstacles: What it would touch there, where it would reach it but for that: names of
            robots, itself among them, and of tables.
        qpos: Joint positions that come nearest, in the descriptor's order (rad, m).
    """

    target: str
    robot: str
    reached: bool
    missing: float
    turn_missing: float
    obstacles: tuple[str, ...]
    qpos: tuple[float, ...]

    @property
    def blocked(self) -> bool:
        """Whether it would reach the target, were it not for a collision."""
        return bool(self.obstacles)


def length_text(metres: float) -> str:
    """Return a length as people write it: ``4.1 cm``, ``1.20 m``."""
    return f"{metres:.2f} m" if abs(metres) >= 1 else f"{metres * 100:.1f} cm"


def links_text(pairs: Sequence[LinkPair], between: tuple[str, str], *, table: bool = False) -> str:
    """Name pairs of links, the deepest first: ``left.panda_hand with right.panda_link7``."""
    one, other = between
    spoken = [
        f"{one}.{a} with {b if table else f'{other}.{b}'} ({length_text(pair.depth)})"
        for pair in pairs[:LISTED_LINKS]
        for a, b in [pair.links]
    ]
    rest = len(pairs) - len(spoken)
    return ", ".join(spoken) + (f" and {rest} more pairs of links" if rest else "")


def reach_text(reach: TargetReach) -> str:
    """Say whether a robot reaches a target, or what keeps it from that."""
    if reach.reached:
        return f"{reach.robot} reaches it"
    if reach.blocked:
        touched = ["itself" if name == reach.robot else name for name in reach.obstacles]
        return f"{reach.robot} would touch {' and '.join(touched)} there"
    turn = f" and {reach.turn_missing:.2f} rad" if reach.turn_missing >= 0.005 else ""
    return f"{reach.robot} stays {length_text(reach.missing)}{turn} away"
