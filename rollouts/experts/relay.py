"""Relay: each robot puts its tip into the baton, takes it along to its zone, and lifts off."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import copysign, pi, radians, remainder

import numpy as np
from numpy.typing import NDArray

from rollouts.experts.geometry import Floats, gripper_facing, heading, planar_distance
from rollouts.experts.rehearsal import first_success
from rollouts.experts.script import CLOSED, Pose, Scene, Script, Waypoint
from tasks import MultiRobotTask
from tasks.relay import find_zones

BATON = "baton"
HIGH = 0.12  # of the tip on its way over the table (m)
OUT = 0.05  # how far the tip rises straight up, out of the baton (m)
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


STYLES = (Style(), Style(legs=8, near=0.05), Style(legs=8, near=0.03, height=0.008, beyond=0.0))


def pass_on(task: MultiRobotTask, seed: int) -> NDArray[np.float32]:
    """Return the actions of all robots, (T, A).

    Args:
        task: A Relay; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If a robot cannot reach what it should.
    """
    return first_success(task, seed, lambda scene: [_script(style, task) for style in STYLES])


def _script(style: Style, task: MultiRobotTask) -> Script:
    zones = [np.array([*zone, 0.0]) for zone in find_zones(task.layout)]
    bases = [np.array(placement.base_position) for placement in task.layout.values()]
    names = list(task.layout)
    return {
        name: _leg(name, style, base, zones[i - 1], zones[i], names[i - 1] if i else None)
        for i, (name, base) in enumerate(zip(names, bases, strict=True))
    }


def _leg(
    robot: str, style: Style, base: Floats, start: Floats, end: Floats, before: str | None
) -> tuple[Waypoint, ...]:
    """One robot's part of the way."""
    first, last = heading(base, start), heading(base, end)
    sweep = remainder(last - first, 2 * pi)
    near, far = planar_distance(base, start), planar_distance(base, end)
    sweep += copysign(style.beyond / far, sweep)

    def tip(place: Floats, height: float) -> list[Pose]:
        at = np.array([*place[:2], height])
        return [(at, gripper_facing(heading(base, at), lean)) for lean in LEANS]

    def around(share: float, closer: float = 1.0) -> Floats:
        """The place on the arc about the base that is so far along, (3,) (m)."""
        angle, distance = first + share * sweep, closer * (near + share * (far - near))
        return base + distance * np.array([np.cos(angle), np.sin(angle), 0.0])

    def wait(scene: Scene) -> list[Pose]:
        return tip(around(0.5, style.waiting), HIGH)

    def at_baton(scene: Scene, height: float) -> list[Pose]:
        return tip(scene.body(BATON)[0], height)

    def along(scene: Scene, share: float) -> list[Pose]:
        return tip(around(share), style.height)

    def up(scene: Scene) -> list[Pose]:
        position, quaternion = scene.tcp(robot)
        return [(position + np.array([0.0, 0.0, OUT]), quaternion)]

    turn = () if before is None else (f"{before}.out",)
    shares = np.arange(1, style.legs + 1) / style.legs
    return (
        Waypoint("wait", wait, CLOSED, near=0.1),
        Waypoint("over", partial(at_baton, height=HIGH), CLOSED, near=0.04, after=turn),
        Waypoint("into", partial(at_baton, height=style.height), CLOSED, near=0.03),
        *(
            Waypoint(f"along {share:.0%}", partial(along, share=share), CLOSED, near=style.near)
            for share in shares[:-1]
        ),
        Waypoint("along 100%", partial(along, share=1.0), CLOSED, near=0.03),
        Waypoint("free", partial(at_baton, height=style.height), CLOSED, near=0.02),
        Waypoint("out", up, CLOSED, near=0.02),
        Waypoint("clear", wait, CLOSED),
    )
