"""Which joints of a URDF are its arm, its gripper, its base: from the tree and the names."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from robots.common.errors import DescriptorError
from robots.urdf.model import ModelJoint, UrdfModel

BASE_WORDS = ("root", "world", "dummy", "planar", "virtual", "odom", "mobile", "wheel")
JAW_WORDS = ("gripper", "jaw", "finger", "claw", "pincer", "knuckle")
END_WORDS = ("ee", "eef", "endeffector", "effector", "tool", "tool0", "grasp")
LONGEST_FINGER = 4  # joints in a row
FARTHEST_SLIDE = 4.0  # m; a slide that goes farther is a way for a whole robot


@dataclass(frozen=True)
class Anatomy:
    """The moving joints of a robot, by what they are for, each in the order base to tip.

    Attributes:
        base: Joints that move the robot as a whole.
        arm: Joints from there to the palm.
        fingers: Joints behind the palm; or the one joint of a jaw.
        body: The others: heads, second arms, wheels.
        palm: Link that carries the fingers, or the last link of the arm.
        tcp: Link of the tool centre point.
        tips: Two links whose mean origin is the tool centre point, if they are named as tips.
        reasons: What was concluded from what, one sentence each.
    """

    base: tuple[ModelJoint, ...]
    arm: tuple[ModelJoint, ...]
    fingers: tuple[ModelJoint, ...]
    body: tuple[ModelJoint, ...]
    palm: str
    tcp: str
    tips: tuple[str, ...]
    reasons: tuple[str, ...]


def find_anatomy(model: UrdfModel, urdf: str) -> Anatomy:
    """Tell the parts of a robot apart.

    Raises:
        DescriptorError: If it has no joint that moves.
    """
    if not model.moving:
        raise DescriptorError(f"{urdf} has no joint that moves; there is nothing to drive")
    reasons: list[str] = []
    chain, fingers, body = _walk(model, reasons)
    if not fingers and chain and _is_jaw(chain[-1]):
        jaw = chain.pop()
        fingers = (jaw,)
        reasons.append(f"gripper: one jaw, {jaw.name}, the last joint, by its name")
    if not fingers:
        reasons.append("gripper: none, as no joints branch at the end and none is named like a jaw")
    base, arm = _split_base(chain, reasons)
    palm = fingers[0].parent if fingers else (arm or base)[-1].child
    tcp, tips = _tool(model, palm, fingers, reasons)
    return Anatomy(base, arm, fingers, body, palm, tcp, tips, tuple(reasons))


def _walk(
    model: UrdfModel, reasons: list[str]
) -> tuple[list[ModelJoint], tuple[ModelJoint, ...], tuple[ModelJoint, ...]]:
    """Follow the longest chain from the root to where it branches into fingers, or ends."""
    chain: list[ModelJoint] = []
    body: list[ModelJoint] = []
    link = model.root
    while nexts := model.moving_on(link):
        if _are_fingers(model, nexts):
            fingers = tuple(f for joint in nexts for f in model.below(joint))
            reasons.append(
                f"gripper: {_listing(fingers)}, as {fingers[0].parent} carries {len(nexts)} short"
                " chains side by side"
            )
            return chain, fingers, tuple(body)
        longest = max(nexts, key=lambda joint: model.depths[joint.name])  # the first of equals
        shorter = [joint for joint in nexts if joint != longest]
        others = [other for joint in shorter for other in model.below(joint)]
        if others:
            reasons.append(
                f"body: {_listing(others)}, as {longest.name} leads on to the longer chain"
                if model.depths[longest.name] > max(model.depths[joint.name] for joint in shorter)
                else f"body: {_listing(others)}, a chain as long as that behind {longest.name}:"
                " a second arm? Then make a group for each"
            )
        body += others
        chain.append(longest)
        link = longest.child
    return chain, (), tuple(body)


def _are_fingers(model: UrdfModel, joints: Sequence[ModelJoint]) -> bool:
    depths = sorted((model.depths[joint.name] for joint in joints), reverse=True)
    return len(depths) > 1 and depths[0] <= LONGEST_FINGER and depths[0] - depths[1] <= 1


def _is_jaw(joint: ModelJoint) -> bool:
    return any(word in name.lower() for word in JAW_WORDS for name in (joint.name, joint.child))


def _split_base(
    chain: Sequence[ModelJoint], reasons: list[str]
) -> tuple[tuple[ModelJoint, ...], tuple[ModelJoint, ...]]:
    count = 0
    while count < len(chain) and _moves_the_whole(chain[count]):
        count += 1
    base, arm = tuple(chain[:count]), tuple(chain[count:])
    if base and not arm:
        base, arm = (), base
        reasons.append(f"arm: {_listing(arm)}; they move the whole robot, which so flies freely")
        return base, arm
    if base:
        reasons.append(
            f"base, held still: {_listing(base)}, by name or by going farther than"
            f" {FARTHEST_SLIDE:g} m"
        )
    if arm:
        reasons.append(f"arm: {_listing(arm)}, the longest chain from the base")
    return base, arm


def _moves_the_whole(joint: ModelJoint) -> bool:
    low, high = joint.span
    far = joint.type == "prismatic" and high - low > FARTHEST_SLIDE
    return far or bool(set(_words(joint.name)) & set(BASE_WORDS))


def _tool(
    model: UrdfModel, palm: str, fingers: Sequence[ModelJoint], reasons: list[str]
) -> tuple[str, tuple[str, ...]]:
    """Return the TCP link, and the tips that its position is the mean of, if there are two."""
    rigid = model.rigid_with(palm)
    for what, fits in (("tcp", _is_tcp), ("the end of an arm", _is_end)):
        named = [link for link in rigid if fits(link)]
        if named:
            also = f"; so are {', '.join(named[1:])}" if named[1:] else ""
            reasons.append(
                f"TCP: the link {named[0]}, named like {what} and rigid with {palm}{also}"
            )
            return named[0], ()
    behind = [link for joint in fingers for link in model.rigid_with(joint.child)]
    tips = [link for link in dict.fromkeys((*rigid, *behind)) if "tip" in _words(link)]
    if len(tips) == 2:
        reasons.append(f"TCP: the middle of {tips[0]} and {tips[1]}, turned as {palm}")
        return palm, (tips[0], tips[1])
    last = palm if fingers else rigid[-1]
    reasons.append(
        f"TCP: the link {last}, for want of one named like a tool;"
        + (" it is the palm, not the place between the fingers" if fingers else " it is the last")
    )
    return last, ()


def _is_tcp(link: str) -> bool:
    return "tcp" in _words(link)


def _is_end(link: str) -> bool:
    words = _words(link)
    return bool(set(words) & set(END_WORDS)) or "end_effector" in "_".join(words)


def _words(name: str) -> list[str]:
    apart = re.sub(r"([a-z0-9])([A-Z])", r"\1_\2", name)
    return [re.sub(r"(?<=tcp)\d+$", "", word) for word in re.split(r"[^a-z0-9]+", apart.lower())]


def _listing(joints: Sequence[ModelJoint]) -> str:
    return ", ".join(joint.name for joint in joints)
