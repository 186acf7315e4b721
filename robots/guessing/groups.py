"""The joint groups of a robot: a limb's are driven, and what is no limb is held."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from robots.action_split import JointGroup
from robots.guessing.anatomy import PARTS, Anatomy, LimbJoints
from robots.guessing.drives import Drive, Drives, alike, drive_fields
from robots.urdf.model import ModelJoint


def arm_groups(limb: LimbJoints, drives: Drives) -> dict[str, JointGroup]:
    """Return the groups of a limb's arm: its joints that turn, and those that slide.

    Args:
        limb: The limb.
        drives: The drives of its joints.
    """
    return {
        name_of(limb, name): by_steps(
            joints,
            [drives.of(joint) for joint in joints],
            reset_noise=joints[0].unit == "rad",  # the same noise for all would be 2 cm of a slide
            approximate_ik=True,
        )
        for name, joints in _by_unit("arm", limb.arm)
    }


def held_groups(anatomy: Anatomy, drives: Drives) -> dict[str, JointGroup]:
    """Return the groups that stay where they start: torso, head, legs, wheels, base.

    Args:
        anatomy: The robot's parts.
        drives: The drives of its joints.
    """
    groups: dict[str, JointGroup] = {}
    for part in PARTS:
        groups.update(held_still(part, anatomy.parts.get(part, ()), drives))
    for name, joints in _by_unit("base", anatomy.base):
        groups[name] = JointGroup.hold(
            _names(joints), stiffness=1e5, damping=1e4, force_limit=1e5, unit=joints[0].unit
        )
    return groups


def held_still(part: str, joints: Sequence[ModelJoint], drives: Drives) -> dict[str, JointGroup]:
    """Return the groups of joints that stay where they start, by name: those that slide apart."""
    return {
        name: JointGroup.hold(
            _names(own), unit=own[0].unit, **drive_fields([drives.holding(joint) for joint in own])
        )
        for name, own in _by_unit(part, joints)
    }


def by_steps(
    joints: Sequence[ModelJoint],
    drives: Sequence[Drive],
    *,
    reset_noise: bool = True,
    approximate_ik: bool = False,
) -> JointGroup:
    """Return a group whose numbers move its joints by steps.

    Args:
        joints: Its joints.
        drives: Their drives.
        reset_noise: Whether a reset adds joint noise.
        approximate_ik: See `robots.JointGroup`.
    """
    steps = [drive.step for drive in drives]
    return JointGroup(
        _names(joints),
        lower=alike([-step for step in steps]),
        upper=alike(steps),
        delta=True,
        unit=joints[0].unit,
        reset_noise=reset_noise,
        limits=tuple(joint.span for joint in joints),
        approximate_ik=approximate_ik,
        **drive_fields(drives),
    )


def name_of(limb: LimbJoints, group: str) -> str:
    """Return the name of a limb's group: ``arm``, ``left_arm``, or ``arm_2``."""
    if not limb.name:
        return group
    return f"{group}_{limb.name}" if limb.name.isdigit() else f"{limb.name}_{group}"


def _by_unit(part: str, joints: Sequence[ModelJoint]) -> Iterator[tuple[str, list[ModelJoint]]]:
    for unit, suffix in (("m", "_slide"), ("rad", "")):
        same = [joint for joint in joints if joint.unit == unit]
        if same:
            yield part + suffix, same


def _names(joints: Sequence[ModelJoint]) -> tuple[str, ...]:
    return tuple(joint.name for joint in joints)
