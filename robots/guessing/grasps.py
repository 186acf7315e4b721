"""What touches the things that a robot grasps, and how its contacts show a grasp."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robots.descriptor import Fingers, GripperMaterial
from robots.guessing.anatomy import Limb
from robots.guessing.fingertips import Fingertips
from robots.urdf.model import UrdfModel

ALONG = 0.7  # cosine; how well a finger's y axis must lie along the way in which it opens
WIDE = 110.0  # degrees; of a finger that swings, as ManiSkill's SO-100 has it


def find_material(model: UrdfModel, limbs: Sequence[Limb]) -> GripperMaterial | None:
    """Return the contact material of all fingers, as ManiSkill's grippers have it."""
    links = tuple(link for limb in limbs if limb.fingers for link in _finger_links(model, limb))
    return GripperMaterial(links, 2.0, 2.0, 0.0, patch_radius=0.1) if links else None


def find_fingers(
    limb: Limb, tips: Fingertips | None, opened: Mapping[str, float]
) -> tuple[Fingers | None, str]:
    """Return the two links that grasp, if a limb has two that open along their y axes, and why.

    Args:
        limb: The limb.
        tips: The tips of its fingers, if it has any.
        opened: Where its joints are when it is open (rad, m).
    """
    none = "fingers: none, so grasps go unnoticed; a Fingers(...) with two links changes that"
    if tips is None or len(tips.ends) != 2:
        return None, none
    ways = tips.opening(opened)
    if min(abs(way) for way in ways) < ALONG:
        return None, none
    swings = any(joint.type != "prismatic" for joint in limb.fingers)
    one, other = (1 if way > 0 else -1 for way in ways)
    links = tips.touching(tips.ends[0]), tips.touching(tips.ends[1])
    fingers = Fingers(links, opening_signs=(one, other))
    if swings:
        return Fingers(fingers.links, fingers.opening_signs, max_angle=WIDE), (
            f"fingers: {' and '.join(links)} swing open along their y axes"
        )
    return fingers, "fingers: both slide along their y axis, in which they open"


def _finger_links(model: UrdfModel, limb: Limb) -> tuple[str, ...]:
    """Return the links of a hand's fingers, with the pads that are fixed to them."""
    own = [joint.child for joint in limb.fingers]
    pads = [p for link in own for p in model.rigid_with(link)[1:] if p in model.collisions]
    return (*((limb.palm,) if len(own) == 1 else ()), *own, *pads)
