"""Where the fingers of a hand meet whose joints are driven each on its own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from robot_layouts.kinematics.rotations import Floats
from robots.guessing.fingertips import Fingertips
from robots.urdf.model import ModelJoint

ITERATIONS = 80
STRIDE = 0.3  # of the way that is left, that tips go at once while they are farther apart than NEAR
NEAR = 0.01  # m
MET = 1e-3  # m; tips that are so near to each other meet
PROBE = 1e-4  # rad, m; by which joints are moved to see where tips go
STEADY = 1e-5  # m²; keeps steps small where joints hardly bring tips nearer
HALVINGS = 12  # of the way between open and closed, on which fingers touch


@dataclass(frozen=True, eq=False)
class Pinch:
    """How two fingers of a hand meet.

    Attributes:
        ends: Their last links.
        joints: Where the joints are then that lead a finger (rad, m).
        place: Where they touch, in the root's frame, as the arm stands mid-range, (3,) (m).
    """

    ends: tuple[str, str]
    joints: Mapping[str, float]
    place: Floats


def find_pinch(
    tips: Fingertips, postures: Sequence[Mapping[str, float]], leaders: Sequence[ModelJoint]
) -> Pinch | None:
    """Return how a thumb and a finger meet, with as little bending as brings them together.

    None if no two ends are known to grasp, the hand has no shapes, or they do not meet.

    Args:
        tips: The tips of the hand.
        postures: Where its joints may stand, open first (rad, m).
        leaders: Its joints that follow no other.
    """
    ends = tips.grasping() or tips.opposed(postures)
    if ends is None or not tips.solid:
        return None
    joints = [joint for joint in leaders if any(tips.moved_by(joint, end) for end in ends)]
    start, *others = map(tips.stance.with_joints, postures)
    met = (_met(tips, ends, posture, joints) for posture in (start, *others))
    found = next(filter(None, (_touching(tips, ends, start, posture) for posture in met)), None)
    if found is None:
        return None
    posture, place = found
    at = {j.name: round(float(posture[tips.stance.index[j.name]]), 6) for j in joints}
    lead = _leading(tips, ends[1], leaders)
    for end in tips.ends:  # fingers built like the one that meets the thumb bend as it does
        beside = _leading(tips, end, leaders)
        if end not in ends and [j.span for j in beside] == [j.span for j in lead]:
            at |= {joint.name: at[like.name] for joint, like in zip(beside, lead, strict=True)}
    return Pinch(ends, at, place)


def _met(
    tips: Fingertips, ends: tuple[str, str], start: Floats, joints: Sequence[ModelJoint]
) -> Floats:
    """Return the posture in which two tips are as near as they come, (leaders,) (rad, m)."""
    columns = [tips.stance.index[joint.name] for joint in joints]
    limits, met = np.array([joint.span for joint in joints]).T, start.copy()
    for _ in range(ITERATIONS):
        rows = np.tile(met, (len(columns) + 1, 1))
        rows[np.arange(len(columns)) + 1, columns] += PROBE
        gap, *moved = tips.gaps(ends, rows)
        slopes, left = (np.array(moved) - gap).T / PROBE, np.linalg.norm(gap)
        if left < MET:
            break
        step = -gap * (STRIDE if left > NEAR else 1.0)
        moves = _least_moves(slopes, step)
        while (stuck := np.clip(met[columns] + moves, *limits) == met[columns]).any():
            if not slopes[:, stuck].any():
                break
            slopes[:, stuck] = 0.0
            moves = _least_moves(slopes, step)
        met[columns] = np.clip(met[columns] + moves, *limits)
    return met


def _least_moves(slopes: Floats, step: Floats) -> Floats:
    """Return the least moves of joints that take a step, (joints,) (rad, m)."""
    return slopes.T @ np.linalg.solve(slopes @ slopes.T + STEADY * np.eye(3), step)


def _touching(
    tips: Fingertips, ends: tuple[str, str], start: Floats, met: Floats
) -> tuple[Floats, Floats] | None:
    """Return the posture on the way to another in which two ends touch, and where they do (m)."""
    apart, touching, place = 0.0, 1.0, tips.contact(ends, met)
    if place is None:
        return None
    for _ in range(HALVINGS):
        share = (apart + touching) / 2
        there = tips.contact(ends, start + share * (met - start))
        if there is None:
            apart = share
        else:
            touching, place = share, there
    return start + touching * (met - start), place


def _leading(tips: Fingertips, end: str, leaders: Sequence[ModelJoint]) -> list[ModelJoint]:
    """Return the joints that lead a finger, outwards."""
    return [joint for joint in leaders if tips.moved_by(joint, end)]
