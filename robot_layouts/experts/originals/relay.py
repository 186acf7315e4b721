"""Relay: each robot puts its tip into the baton, takes it along to its zone, and lifts off."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import copysign, pi, radians, remainder

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import heading, planar_distance
from robot_layouts.experts.reaching import reaching
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.originals.relay import find_zones

BATON = "baton"
HIGH = 0.07  # of the tip on its way over the table (m)
OUT = 0.04  # how far the tip rises straight up, out of the baton (m)
LEANS = tuple(map(radians, (0, 20, 40)))  # of an arm, from straight down, outwards


@dataclass(frozen=True)
class Style:
    """How the baton is taken along.

    Attributes:
        legs: In how many parts; between them the arm's joints go straight, not the tip.
        height: Of the tip over the table in the baton (m).
        beyond: How far beyond its zone's middle the tip goes: the baton lags behind (m).
        near: How near the arm must come to the end of a part before the next (rad).
        waiting: Share of its distance to its zones at which a robot waits.
    """

    legs: int = 4
    height: float = 0.012
    beyond: float = 0.02
    near: float = 0.1
    waiting: float = 0.75


STYLES = (
    Style(),
    Style(legs=8, near=0.05),
    Style(legs=8, near=0.03, height=0.008, beyond=0.0),
    Style(waiting=0.6),
)


def pass_on(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions of all robots, (T, A).

    Args:
        task: A Relay; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If a robot cannot reach what it should.
    """
    return first_success(
        task, seed, lambda scene: [_script(style, task, scene) for style in STYLES]
    )


def _script(style: Style, task: TaskEnv, scene: Scene) -> Script:
    zones = [np.array([*zone, 0.0]) for zone in find_zones(task.layout)]
    names = list(task.layout.arms)
    script: dict[str, tuple[Waypoint, ...]] = {}
    for i, name in enumerate(names):
        part = _Part(style, task, name, scene.base(name), zones[i - 1], zones[i])
        script[name] = part.waypoints(after=names[i - 1] if i else None)
    return script


class _Part:
    """One robot's part of the way: an arc about its base, from the zone before to its own."""

    def __init__(
        self,
        style: Style,
        task: TaskEnv,
        robot: str,
        base: Floats,
        start: Floats,
        end: Floats,
    ) -> None:
        self._style, self._robot = style, robot
        self._base = base
        self._go = partial(reaching, task, robot, leans=LEANS, as_it_is=False, gripper=CLOSED)
        self._start = heading(base, start)
        self._sweep = remainder(heading(base, end) - self._start, 2 * pi)
        self._near, self._far = planar_distance(base, start), planar_distance(base, end)
        self._sweep += copysign(style.beyond / self._far, self._sweep)

    def waypoints(self, after: str | None) -> tuple[Waypoint, ...]:
        """Return all of them; those in the baton wait until the robot ``after`` has left it."""
        near, legs = self._style.near, self._style.legs
        turn = () if after is None else (f"{after}.out",)
        into = partial(self._at_baton, height=self._style.height)
        return (
            self._go("wait", self._waiting, near=0.1),
            self._go("over", partial(self._at_baton, height=HIGH), near=0.04, after=turn),
            self._go("into", into, near=0.03),
            *(
                self._go(f"along {i + 1}", partial(self._along, share=(i + 1) / legs), near=near)
                for i in range(legs - 1)
            ),
            self._go("deliver", partial(self._along, share=1.0), near=0.03),
            self._go("free", into, near=0.02),
            self._go("out", self._above, near=0.02),
            self._go("clear", self._waiting),
        )

    def _arc(self, share: float, height: float, closer: float = 1.0) -> Floats:
        """Return the place on the arc that is so far along, (3,) (m)."""
        angle = self._start + share * self._sweep
        distance = closer * (self._near + share * (self._far - self._near))
        x, y = self._base[:2] + distance * np.array([np.cos(angle), np.sin(angle)])
        return np.array([x, y, height])

    def _waiting(self, scene: Scene) -> Floats:
        return self._arc(0.5, HIGH, self._style.waiting)

    def _at_baton(self, scene: Scene, height: float) -> Floats:
        return np.array([*scene.body(BATON)[0][:2], height])

    def _along(self, scene: Scene, share: float) -> Floats:
        return self._arc(share, self._style.height)

    def _above(self, scene: Scene) -> Floats:
        return scene.tcp(self._robot)[0] + np.array([0.0, 0.0, OUT])
