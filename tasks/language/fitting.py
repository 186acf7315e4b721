"""How a task's places and sizes fit the robots that it is made with.

A task is declared in numbers for its own robots. Other robots reach less or farther, stand
elsewhere, and hold smaller or larger things: their `Fit` says where the origin of the declaration
lies between them, how it is turned, and by which factor it is larger.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import atan2, inf, pi

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from layouts.frames import Pose, Rectangle
from layouts.placement import Placement
from layouts.shared_place import shared_place, working_factors
from robot_layouts.simulation.framed import AS_DECLARED, Fit
from robots import DescriptorError, RobotDescriptor, TaskError
from robots.gripper_motion import gripper_motion
from robots.parts import PINCH

_ROOM = 0.04  # m that a declaration for a Panda needs about its origin, in reach of all arms
_HELD = 0.75  # of a gripper's opening that a body to be held may take
_PINCHED = 0.4  # the same between finger tips that meet, which are round and may turn
_SPLAYED = 0.28  # rad; between jaws that are turned more a body is held by its edges, and slips out
_LARGEST, _SMALLEST = 3.0, 0.05
_ASTRAY = 0.02  # m by which arms have to stand better about the origin as it is for it to stay
_DIGITS = 3  # of places and turns: bases are rounded, too
_FLAT = 1e-6  # m and sine: so far a frame may lie off the ground, and its z axis off the vertical
TASK = "task"  # a layout's frame of that name says where the declaration lies


def fit_to(
    layout: Layout,
    declared: Layout,
    held: Mapping[str, float],
    needed: Mapping[str, float],
    table: Rectangle | None = None,
) -> Fit:
    """Return how a declaration fits other robots, or others' places.

    It is turned as the arms are about their middle, and as much larger as each of them reaches
    farther than its place needs, or than the one of the task's own that reaches least, unless that
    is more than grippers can hold or than there is room. Its origin lies where it does in
    `layouts.at_task`, or, if it is for two arms or one, where they reach well, as near to that as
    they do. It stays as declared where arms stand better about that. A layout's frame ``task``
    says itself where the declaration lies.

    Args:
        layout: The robots that are to do the task.
        declared: The task's own layout.
        held: Width of the widest body that each of them holds, as declared, by place (m); those
            that hold none are left out.
        needed: How far arms have to reach where the task's own stand, by place (m), where the task
            says so.
        table: Outline of the table, x_min, y_min, x_max, y_max (m).

    Raises:
        TaskError: If no place is in reach of both arms, or the frame ``task`` is not level.
        AssetError: If robot files cannot be found.
    """
    arms = [layout.arm(place) for place in declared.places]
    own = [declared.arm(place) for place in declared.places]
    said = layout.frame_poses.get(TASK)
    if said is None and all(_alike(*pair) for pair in zip(arms, own, strict=True)):
        return AS_DECLARED
    scale, factors = working_factors(layout, declared, declared.places, held, needed)
    if held:
        widest = max(held.values())
        others = [arm.robot for arm, its in zip(arms, own, strict=True) if not _able(arm, its)]
        scale = min([scale, *(_holds(robot) / widest for robot in others if _opening(robot))])
    if said is not None:
        return Fit(min(max(scale, _SMALLEST), _LARGEST), *_level(said))
    turn = _turn(own, arms)
    (x, y), room = _origin(own, arms, factors, turn, scale), inf
    moved, as_it_is = (_astray(own, arms, factors, at) for at in (complex(x, y), 0j))
    apart = len({layout.owner(place) for place in declared.places}) == len(arms) > 1
    if apart and abs(turn) < pi / 2 and as_it_is < moved - _ASTRAY:
        x, y, turn = 0.0, 0.0, 0.0
    elif len(arms) <= 2:  # more of them need not all reach it
        near = (x, y) if apart or len(arms) == 1 else None  # limbs reach where their body has them
        if (shared := shared_place(layout, tuple(declared.places), table, near=near)) is None:
            robots = {place: layout.arm(place).robot.name for place in declared.places}
            names = ", ".join(f"{place!r} ({robot})" for place, robot in robots.items())
            raise TaskError(
                f"no place on the ground is in reach of all of {names}, gripper down; place them"
                " nearer to each other, as layouts.face_to_face(…, spacing='auto') does"
            )
        (x, y), room = shared
    scale = min(scale, room / _ROOM)
    return Fit(min(max(scale, _SMALLEST), _LARGEST), x, y, turn)


def _level(frame: Pose) -> tuple[float, float, float]:
    """Return where a frame on the ground lies, x and y (m), and its turn about z (rad).

    Raises:
        TaskError: If it lies elsewhere, or is tilted.
    """
    (x, y, z), (w, i, j, k) = frame.position, frame.quaternion
    if max(abs(z), abs(i), abs(j)) > _FLAT:
        raise TaskError(
            f"the layout's frame {TASK!r} says where the task lies: at z = 0, turned about z alone;"
            f" it is at z = {z:g} with the orientation {frame.quaternion}"
        )
    return x, y, 2 * atan2(k, w)


def _turn(own: Sequence[Placement], arms: Sequence[Placement]) -> float:
    """Return by how much arms are turned about their middle from where a task's own stand (rad)."""
    if len(arms) == 1:
        return 0.0
    before, after = (_flat(bases) - np.mean(_flat(bases)) for bases in (own, arms))
    return round(float(np.angle(np.sum(np.conj(before) * after))), _DIGITS) + 0.0


def _origin(
    own: Sequence[Placement],
    arms: Sequence[Placement],
    factors: Sequence[float],
    turn: float,
    scale: float,
) -> tuple[float, float]:
    """Return where the origin of a declaration is by where arms stand (m).

    They stand about the middle of the task's own as much farther as factors say, and what is
    declared there stays there.
    """
    declared = np.mean(_flat(own))
    middle = np.mean(_flat(arms) - np.array(factors) * np.exp(1j * turn) * (_flat(own) - declared))
    at = middle - scale * np.exp(1j * turn) * declared
    return round(float(at.real), _DIGITS) + 0.0, round(float(at.imag), _DIGITS) + 0.0


def _astray(
    own: Sequence[Placement], arms: Sequence[Placement], factors: Sequence[float], origin: complex
) -> float:
    """Return by how much arms stand farther from an origin, or nearer, than they are to (m)."""
    wanted = np.array(factors) * np.abs(_flat(own))
    return float(np.abs(np.abs(_flat(arms) - origin) - wanted).max())


def _flat(bases: Sequence[Placement]) -> NDArray[np.complex128]:
    """Return the bases of arms in the plane, x + iy (m)."""
    return np.array([complex(*arm.base_position[:2]) for arm in bases])


def _alike(arm: Placement, own: Placement) -> bool:
    """Return whether an arm stands where a task's own does, and reaches and holds as much."""
    return arm.base_pose == own.base_pose and _able(arm, own)


def _able(arm: Placement, own: Placement) -> bool:
    """Return whether an arm reaches and holds as much as a task's own."""
    one, other = arm.robot, own.robot
    if one == other:
        return True
    return one.reach == other.reach and _opening(one) == _opening(other)


def _opening(robot: RobotDescriptor) -> float | None:
    """Return how wide a gripper opens, to 0.1 mm (m); None of one that has no fingers."""
    try:
        return round(gripper_motion(robot).widest, 4)
    except DescriptorError:
        return None


def _holds(robot: RobotDescriptor) -> float:
    """Return the width of the widest body that a gripper holds well (m)."""
    motion = gripper_motion(robot)
    if PINCH in robot.keyframes:
        return _PINCHED * motion.widest
    return min(_HELD * motion.widest, motion.widest_within(_SPLAYED))
