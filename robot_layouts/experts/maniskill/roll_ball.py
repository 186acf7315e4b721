"""Rolling a ball onto a far target: an underarm swing hits it, and its aim is rehearsed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from math import radians

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.geometry import gripper_facing, heading, planar_distance, turn
from robot_layouts.experts.rehearsal import Attempt, Rehearsal, search
from robot_layouts.experts.script import CLOSED, Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats, multiply
from robot_layouts.simulation.backend import PoseSolver
from tasks import TaskEnv

ARM, BALL, TARGET = "arm", "ball", "goal_region"

ABOVE = 0.07  # of the TCP over where the swing begins, on the way there (m)
SIDES = np.radians((0, 90, 180, -90))  # turns of the gripper about its approach; any side may hit
SWING = 0.35  # of every joint that takes part (rad)
LEVER = 0.1  # of joints that take part, at least: TCP speed by joint speed (m)
SHOTS = 5  # with one style
CORRECTION = 0.4  # of the aim, by the error of the shot: a round ball exaggerates
MISSED = 0.1  # a ball that came less far was not hit (m)


@dataclass(frozen=True)
class Style:
    """How the ball is hit.

    Attributes:
        tilt: Angle of the gripper from straight down where the swing begins, away from the arm
            (rad).
        gap: Between the TCP and the ball's middle there (m).
        height: Of the TCP over the table there (m).
    """

    tilt: float = radians(-15)
    gap: float = 0.07
    height: float = 0.02


STYLES = (
    Style(),
    Style(tilt=0.0),
    Style(tilt=radians(-30)),
    Style(gap=0.06),
    Style(gap=0.08),
    Style(tilt=radians(-30), gap=0.06),
    Style(tilt=0.0, gap=0.06),
)


def roll(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions that roll the ball onto its target, (T, A).

    Args:
        task: A RollBall; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If the arm cannot reach behind the ball.
    """
    return search(task, seed, partial(_shots, seed=seed))


def _shots(rehearsal: Rehearsal, seed: int) -> Iterator[Attempt]:
    """Shoot in every style, a few times each, the aim corrected by where the ball went."""
    kinematics = rehearsal.task.simulation.backend.inverse_kinematics(ARM)
    for style in STYLES:
        aim, correction, last_error = 0.0, CORRECTION, 0.0
        for _ in range(SHOTS):
            before = rehearsal.begin(seed)
            yield rehearsal.play(_Shot(style, kinematics, before, aim).script())
            (start, _), (end, _) = before.body(BALL), rehearsal.scene().body(BALL)
            if planar_distance(start, end) < MISSED:
                break
            target, _ = before.body(TARGET)
            error = _angle(heading(start, target), heading(start, end))
            if error * last_error < 0:
                correction /= 2
            aim, last_error = aim - correction * error, error


class _Shot:
    """One swing, worked out from where ball and target are."""

    def __init__(self, style: Style, kinematics: PoseSolver, scene: Scene, aim: float) -> None:
        self.style, self.kinematics = style, kinematics
        self.ball, target = scene.body(BALL)[0], scene.body(TARGET)[0]
        self.direction = heading(self.ball, target) + aim
        self.ahead = np.array([np.cos(self.direction), np.sin(self.direction), 0.0])

    def script(self) -> Script:
        return {
            ARM: (
                Waypoint("above", partial(self.behind, above=ABOVE), CLOSED, near=0.1),
                Waypoint("behind", partial(self.behind, above=0.0), CLOSED),
                Waypoint("swing", gripper=CLOSED, turn=self.swing),
            )
        }

    def behind(self, scene: Scene, above: float) -> list[Pose]:
        x, y, _ = self.ball - self.style.gap * self.ahead
        place = np.array([x, y, self.style.height + above])
        facing = gripper_facing(self.direction, self.style.tilt)
        return [(place, multiply(facing, turn("z", side))) for side in SIDES]

    def swing(self, arm: Floats) -> Floats:
        """Turn all joints that move the TCP ahead, as fast as each can."""
        here, _ = self.kinematics.forward(arm)
        moved = [self.kinematics.forward(arm + bit)[0] for bit in _BIT * np.eye(len(arm))]
        levers = (np.array(moved) - here) @ self.ahead / _BIT
        return SWING * np.sign(levers) * (np.abs(levers) > LEVER)


def _angle(start: float, end: float) -> float:
    """Return the angle from one heading to another, in [-π, π)."""
    return (end - start + np.pi) % (2 * np.pi) - np.pi


_BIT = 1e-3  # rad; for finite differences
