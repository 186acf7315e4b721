"""Pushing the T onto its outline: plan, push a little, look, and plan anew."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from robot_layouts.experts.driver import ArmDriver
from robot_layouts.experts.geometry import gripper_facing, heading, yaw_of
from robot_layouts.experts.maniskill.push_plans import APPROACH, Push, PushPlanner, Situation
from robot_layouts.experts.maniskill.sliding import SlidingBody, to_body
from robot_layouts.experts.rehearsal import Attempt, Rehearsal, search
from robot_layouts.experts.script import OPEN, Scene
from robot_layouts.kinematics.rotations import Floats
from tasks import TaskEnv
from tasks.maniskill.push_t import BAR_HALF_SIZE, CENTRE_OF_MASS_Y, STEM_HALF_SIZE

ARM, TEE, OUTLINE = "arm", "Tee", "goal_Tee"
ATTEMPTS = 8  # each with chances of its own
TIP_RADIUS = 0.008  # m; of panda_stick.urdf's cylinder
# Fitted to 250 short pushes in simulation, each at a random contact in a random direction.
BODY = SlidingBody(centre=(0.0, -0.005), torque_arm=0.087, tip_radius=TIP_RADIUS)
PUSHING, LIFTED = 0.022, 0.05  # m; heights of the tip; the T is 0.04 high
CLEARANCE = 0.004  # m; between the tip and the T on a way along the table
LOOK_AFTER = 0.04  # m; pushed before the next look
SPACING = 0.012  # m; between waypoints along a push
OVERSHOOT = 0.006  # m; the last waypoint of a push lies so much further: the arm gives way
CONTACT_SPACING, FROM_CORNER, FROM_INNER_CORNER = 0.005, 0.006, 0.016  # m
LOST = 0.006  # m; a tip farther from any contact is no longer at the T
PATIENCE = 6  # control steps for each waypoint along a push
FEW = 5  # plans in a row that may come to nothing


def push_onto_outline(task: TaskEnv, seed: int) -> NDArray[np.float32]:
    """Return the actions that push the T onto its outline, (T, A).

    Args:
        task: A PushT; says layout and physics.
        seed: The episode.

    Raises:
        TaskError: If the arm cannot reach the T at all.
    """

    def attempts(rehearsal: Rehearsal) -> Iterator[Attempt]:
        for chance in range(ATTEMPTS):
            scene = rehearsal.begin(seed)
            random = np.random.default_rng((seed, chance))
            yield _Pusher(rehearsal, scene, random).play()

    return search(task, seed, attempts)


class _EndedError(Exception):
    """The episode is over."""


class _OutOfReachError(Exception):
    """No joints bring the stick to a place."""


class _Pusher:
    """One attempt: pushes the T in a private task, from its present state."""

    def __init__(self, rehearsal: Rehearsal, scene: Scene, random: np.random.Generator) -> None:
        self._rehearsal, self._scene = rehearsal, scene
        self._task = task = rehearsal.task
        self._kinematics = task.simulation.backend.inverse_kinematics(ARM)
        self._driver = ArmDriver(task.layout.arm(ARM).robot)
        self._base = scene.base(ARM)
        self._contacts = contacts()
        self._planner = PushPlanner(
            BODY, self._contacts, _planar(scene, OUTLINE), self._base[:2], random
        )
        # The stick keeps its angle to the way from the base: the last joint hardly has to turn.
        tip, quaternion = scene.tcp(ARM)
        self._turned = yaw_of(quaternion) - heading(self._base, tip)
        self._actions: list[NDArray[np.float32]] = []
        self._success = False

    def play(self) -> Attempt:
        """Push until success, the end of the episode, or until no plan comes to anything."""
        touching, failures, reason = None, 0, "the T did not come to its outline in time"
        try:
            while failures < FEW:
                push = self._planner.next_push(self._situation(touching))
                try:
                    touching = None if push is None else self._push(push)
                    failures = failures + 1 if push is None else 0
                except _OutOfReachError:
                    touching, failures, reason = None, failures + 1, "the T is out of reach"
        except _EndedError:
            pass
        actions = np.array(self._actions, np.float32).reshape(-1, self._task.layout.action_dim)
        return Attempt(actions, self._success, "" if self._success else reason)

    def _situation(self, normal: Floats | None) -> Situation:
        """Say where everything is; ``normal`` is that of the side that the tip touches."""
        pose, tip = _planar(self._scene, TEE), self._tip()
        touching = None
        if normal is not None:
            point = to_body(pose, tip[None])[0] - TIP_RADIUS * normal
            touching = np.concatenate([point, normal])
            if np.abs(self._contacts - touching).max(1).min() > LOST:
                touching = None
        left = self._task.max_episode_steps - len(self._actions)
        return Situation(pose, tip, touching, left)

    def _push(self, push: Push) -> Floats:
        """Begin a push, and return the normal of the side that it pushes."""
        pose = _planar(self._scene, TEE)
        if not push.goes_on:
            self._travel(pose, BODY.tips(pose[None], push.contact[None], APPROACH)[0])
        ends = np.minimum(np.cumsum(push.lengths), LOOK_AFTER)
        lengths = np.diff(ends, prepend=0.0)
        slides = BODY.push(pose[None], push.contact[None], push.directions[None], lengths[None])
        track = [BODY.tips(slide.poses, slide.contacts)[0] for slide in slides]
        places = _spaced(self._tip(), track)
        if not places or push.lengths.sum() <= LOOK_AFTER:
            places.append(_beyond(track))
        for place in places:
            self._go(place, PUSHING, near=0.02, least=1, most=PATIENCE)
        return push.contact[2:]

    def _travel(self, pose: Floats, place: Floats) -> None:
        """Bring the tip to a place on the table, over the T if need be."""
        self._joints(place, PUSHING)  # out of reach should be known before the arm moves
        tip = self._tip()
        way = tip + np.linspace(0.0, 1.0, 25)[:, None] * (place - tip)
        if touches(to_body(pose, way)).any():
            self._go(tip, LIFTED, near=0.02)
            self._go(place, LIFTED, near=0.012)
            self._go(place, PUSHING, near=0.02)
        else:
            self._go(place, PUSHING, near=0.03)

    def _go(
        self, place: Floats, height: float, near: float, least: int = 0, most: int = 40
    ) -> None:
        """Move the tip until the arm's joints are near enough (rad), or ``most`` steps long."""
        goal = self._joints(place, height)
        for step in range(most):
            away = np.abs(self._driver.arm(self._scene.qpos(ARM)) - goal).max()
            if step >= least and away <= near:
                return
            self._step(self._driver.action(goal, OPEN, self._scene.qpos(ARM)))

    def _joints(self, place: Floats, height: float) -> Floats:
        """Return the arm's joints (rad) with the tip at a place (m), the stick upright.

        Raises:
            _OutOfReachError: If there are none.
        """
        position = np.array([*place, height])
        quaternion = gripper_facing(self._turned + heading(self._base, position), 0.0)
        goal = self._kinematics.solve(position, quaternion, self._scene.qpos(ARM))
        if goal is None:
            raise _OutOfReachError
        return goal

    def _step(self, action: Floats) -> None:
        """Take one control step.

        Raises:
            _EndedError: If the episode is over then.
        """
        self._actions.append(action.astype(np.float32))
        self._success, _ = self._rehearsal.step(self._actions[-1])
        self._scene = self._rehearsal.scene()
        if self._success or len(self._actions) == self._task.max_episode_steps:
            raise _EndedError

    def _tip(self) -> Floats:
        return self._scene.tcp(ARM)[0][:2]


def contacts() -> Floats:
    """Return where the T may be pushed: points (m) and outward normals in its frame, (C, 4)."""
    corners = [np.array(corner) for corner in _CORNERS]
    rows: list[Floats] = []
    for i, (start, end) in enumerate(pairwise([*corners, corners[0]])):
        length = float(np.linalg.norm(end - start))
        along = (end - start) / length
        margins = [
            FROM_INNER_CORNER if j % len(corners) in _INNER else FROM_CORNER for j in (i, i + 1)
        ]
        count = int((length - sum(margins)) / CONTACT_SPACING)
        for way in np.linspace(margins[0], length - margins[1], count):
            rows.append(np.array([*(start + way * along), along[1], -along[0]]))
    return np.array(rows)


def touches(points: Floats) -> NDArray[np.bool_]:
    """Return whether a tip at points (K, 2) of the T's frame (m) is at or nearly at the T, (K,)."""
    margin = TIP_RADIUS + CLEARANCE
    parts = ((BAR_HALF_SIZE, _BAR_Y), (STEM_HALF_SIZE, _STEM_Y))
    return np.any(
        [(np.abs(points - (0.0, y)) < np.array(half) + margin).all(1) for half, y in parts], axis=0
    )


def _planar(scene: Scene, body: str) -> Floats:
    """Return x, y (m) and yaw (rad) of a body."""
    position, quaternion = scene.body(body)
    return np.array([*position[:2], yaw_of(quaternion)])


def _spaced(start: Floats, track: Sequence[Floats]) -> list[Floats]:
    """Return places of a track, at least `SPACING` apart and from ``start``."""
    places = [start]
    for place in track:
        if np.linalg.norm(place - places[-1]) >= SPACING:
            places.append(place)
    return places[1:]


def _beyond(track: Sequence[Floats]) -> Floats:
    """Return a place a little beyond the end of a track."""
    ahead = track[-1] - track[-3]
    return track[-1] + OVERSHOOT * ahead / max(1e-9, float(np.linalg.norm(ahead)))


_BAR_Y = -CENTRE_OF_MASS_Y
_STEM_Y = 4 * BAR_HALF_SIZE[1] - CENTRE_OF_MASS_Y
_TOP, _BOTTOM, _END = (
    _BAR_Y - BAR_HALF_SIZE[1],
    _BAR_Y + BAR_HALF_SIZE[1],
    _STEM_Y + STEM_HALF_SIZE[1],
)
_WIDE, _NARROW = BAR_HALF_SIZE[0], STEM_HALF_SIZE[0]
# Counterclockwise, so that outward is to the right of the way.
_CORNERS = (
    (-_WIDE, _TOP),
    (_WIDE, _TOP),
    (_WIDE, _BOTTOM),
    (_NARROW, _BOTTOM),
    (_NARROW, _END),
    (-_NARROW, _END),
    (-_NARROW, _BOTTOM),
    (-_WIDE, _BOTTOM),
)
_INNER = (3, 6)
