"""Where the tips of a hand's fingers are, and how far apart."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import product

import numpy as np

from robot_layouts.kinematics.rotations import Floats, inverse_pose, transform
from robots.bodies.hulls import Hull
from robots.bodies.overlaps import contact
from robots.guessing import words
from robots.guessing.anatomy import LimbJoints
from robots.guessing.doubt import Doubt
from robots.guessing.stance import Stance
from robots.parts import Fingers, GripperMaterial, Vector3
from robots.urdf.model import ModelJoint, UrdfModel

SHORT = 0.6  # of the longest finger; what ends before it is a knuckle, not a tip
FOLLOWING = 0.85  # the same where all joints follow one, as in grippers with knuckles
PAD = 0.02  # of a finger's length; a pad that ends so near the finger's end is what touches
FLUSH = 5e-4  # m; how much farther in a pad must lie than what carries it
CAP = 0.15  # of a finger's length; its corners within it from the end make its tip
ALONG = 0.7  # cosine; how well a finger's y axis must lie along the way in which it opens
EXACTLY = 0.95  # the same of its other axes
STILL = 1e-3  # m; fingers whose tips part less do not open
AGAINST = -0.2  # cosine; tips that close on each other move so much against each other, at least
THUMB = ("thumb", "th", "thj")
# Fingers that a thumb meets, the first one first; a Shadow hand's joints are FFJ1, MFJ1 and so on.
OPPOSITE = (("index", "ff", "ffj"), ("middle", "mf", "mfj"))
WIDE = 110.0  # degrees; of a finger that swings, as ManiSkill's SO-100 has it


class Fingertips:
    """The tips of one hand: points of its last links, the farthest from the palm.

    Attributes:
        stance: The robot.
        limb: The limb that ends in the hand.
        ends: The last link of each finger.
        solid: Whether shapes tell where the tips are, not frames alone.
    """

    def __init__(self, stance: Stance, limb: LimbJoints, hulls: Sequence[Hull]) -> None:
        """Find the tips; ``hulls`` are the robot's, or empty to go by frames alone."""
        self.stance, self.limb = stance, limb
        self._poses = stance.poses(stance.middle)[0]
        self._palm = self._poses[stance.tree.link(limb.palm)]
        self._hulls, self.solid = hulls, bool(hulls)
        leaves = [joint for joint in limb.fingers if not stance.model.moving_on(joint.child)]
        palm = self._palm[:3, 3]
        tips = {j.child: self._outermost(self._points(j.child), palm) for j in leaves}
        far = {link: float(np.linalg.norm(tip - palm)) for link, tip in tips.items()}
        longest = max(far.values(), default=0.0)
        led = sum(joint.mimics is None for joint in limb.fingers) == 1
        least = (FOLLOWING if led else SHORT) * longest
        ends = [link for link in tips if far[link] >= least]
        self.ends = tuple([link for link in ends if words.has(link, words.TIP)] or ends)
        if len(limb.fingers) > 0 and len(self.ends) == 1:
            tips[limb.palm] = self._fixed_tip(self.ends[0], tips[self.ends[0]])
            self.ends = (limb.palm, *self.ends)
        self._tips = {link: tips[link] for link in self.ends}

    @property
    def are_jaws(self) -> bool:
        """Whether two sides meet in one place, and shapes tell where."""
        return self.solid and (len(self.ends) == 2 or bool(self._two_fingers()))

    def middle(self) -> Floats:
        """Return the place between the tips, in the root's frame, (3,) (m).

        Where one finger is called a thumb, that is half-way between it and the others; where two
        fingers have several tips, half-way between those.
        """
        thumbs = [link for link in self.ends if self.is_thumb(link)]
        others = [link for link in self.ends if link not in thumbs]
        groups = self._two_fingers() or [group for group in (thumbs, others) if group]
        means = [np.mean([self._tips[link] for link in group], axis=0) for group in groups]
        return np.mean(means, axis=0)

    def apart(self, positions: Mapping[str, float], ends: Iterable[str] = ()) -> float:
        """Return how far tips, or some, are from the middle of all (m), with joints elsewhere."""
        places = self._places(self.stance.poses(self.stance.with_joints(positions))[0])
        which = [self.ends.index(end) for end in ends] or slice(None)
        return float(np.linalg.norm(places - places.mean(axis=0), axis=1)[which].mean())

    def _places(self, poses: Floats) -> Floats:
        """Return the tips where the links have some poses, (ends, 3) (m)."""
        links = [self.stance.tree.link(end) for end in self.ends]
        points = np.array([self._tips[end] for end in self.ends])
        return transform(poses[links], transform(inverse_pose(self._poses[links]), points))

    def gaps(self, ends: Sequence[str], postures: Floats) -> Floats:
        """Return the way from one tip to another in some postures, (postures, 3) (m)."""
        one, other = self._pair(ends, postures).transpose(1, 0, 2)
        return other - one

    def _pair(self, ends: Sequence[str], postures: Floats) -> Floats:
        """Return two tips in some postures, in the root's frame, (postures, 2, 3) (m)."""
        which = [self.ends.index(end) for end in ends]
        return np.array([self._places(poses)[which] for poses in self.stance.poses(postures)])

    def contact(self, ends: Sequence[str], posture: Floats) -> Floats | None:
        """Return where two ends touch in a posture, root's frame, (3,) (m); None if apart."""
        links = self.stance.tree.links
        one, other = (
            [i for i, hull in enumerate(self._hulls) if links[hull.link] in rigid]
            for rigid in map(self.stance.model.rigid_with, ends)
        )
        poses = self.stance.poses(posture)[0]
        return contact(self._hulls, poses, list(product(one, other)))

    def moved_by(self, joint: ModelJoint, end: str) -> bool:
        """Tell whether a joint, or one that follows it, moves an end."""
        path = self.stance.model.path_to(end)
        return any(joint.name in (on.name, on.mimics) for on in path)

    def touching(self, end: str) -> str:
        """Return the link that touches what a finger holds: of those rigid with ``end`` the last.

        Where pads or tips are links of their own, fixed to one that moves, they have the shapes
        that go farthest from the palm. Of several that go as far it is the innermost one.
        """
        rigid = {self.stance.tree.link(link): link for link in self.stance.model.rigid_with(end)}
        outwards = self._outwards(end)
        shapes: list[tuple[str, float, float]] = []  # link, how far it goes, how far inwards (m)
        for hull in self._hulls:
            if hull.link in rigid:
                corners = transform(self._poses[hull.link], hull.corners)
                reach = np.linalg.norm(corners - self._palm[:3, 3], axis=1).max()
                shapes.append((rigid[hull.link], float(reach), float((corners @ outwards).min())))
        farthest = max((reach for _, reach, _ in shapes), default=0.0)
        near = [(link, inner) for link, reach, inner in shapes if reach >= farthest * (1 - PAD)]
        innermost = min((inner for _, inner in near), default=0.0) + FLUSH
        inside = {link for link, inner in near if inner <= innermost}
        touching = [link for link in rigid.values() if link in inside]
        return end if end in inside or not touching else touching[-1]

    def lever(self, end: str, joint: ModelJoint) -> float:
        """Return how far a tip goes outwards as one joint alone moves (m per rad, or 1)."""
        link = self.stance.tree.link(joint.child)
        pose, axis = self._poses[link], self._poses[link, :3, :3] @ self.stance.tree.axes[link]
        way = axis if joint.unit == "m" else np.cross(axis, self._tips[end] - pose[:3, 3])
        return abs(float(way @ self._outwards(end)))

    def grasping(self) -> tuple[str, str] | None:
        """Return the two ends that grasp, one of each finger, or a thumb and what it meets."""
        thumbs = [end for end in self.ends if self.is_thumb(end)]
        others = [end for end in self.ends if end not in thumbs]
        if not thumbs or not others:
            ends = [finger[0] for finger in self._two_fingers()] or self.ends
            return (ends[0], ends[1]) if len(ends) == 2 else None
        named = [[end for end in others if self.is_called(end, known)] for known in OPPOSITE]
        return thumbs[0], next((ends[0] for ends in named if ends), others[0])

    def opposed(self, postures: Sequence[Mapping[str, float]]) -> tuple[str, str] | None:
        """Return two of several ends that close on each other: a thumb, whatever it is called.

        That one comes first which closes most against all others. Where no tips do, as those of
        fingers side by side, there are none.

        Args:
            postures: Where the joints are, open first, then less and less (rad, m).
        """
        if len(self.ends) < 3 or len(postures) < 2:
            return None
        stances = [self.stance.with_joints(postures[at]) for at in (0, len(postures) // 2)]
        wide, half = map(self._places, self.stance.poses(np.array(stances)))
        ways = (half - wide) / np.maximum(np.linalg.norm(half - wide, axis=1, keepdims=True), STILL)
        along = np.round(ways @ ways.T, 1)
        thumb = int(along.sum(axis=1).argmin())
        other = int(along[thumb].argmin())
        return (self.ends[thumb], self.ends[other]) if along[thumb, other] <= AGAINST else None

    def _two_fingers(self) -> list[list[str]]:
        """Return the tips of each of two fingers, of which one has several; else nothing."""
        if len(self.ends) < 3 or any(map(self.is_thumb, self.ends)):
            return []
        fingers: dict[str, list[str]] = {}
        for end in self.ends:
            fingers.setdefault(self.finger_of(end).name, []).append(end)
        return list(fingers.values()) if len(fingers) == 2 else []

    def opening(self, ends: Sequence[str], postures: Sequence[Mapping[str, float]]) -> Floats:
        """Return which way two fingers open, in the frames of the links that touch, (2, 3).

        That is how their tips part at first, from that of some postures in which they are nearest
        to the one before: a jaw that swings wide open goes back. Where they stay as far apart, it
        is the line from tip to tip, in the posture half-way.
        """
        places = [self.ends.index(end) for end in ends]
        poses = self.stance.poses(np.array([self.stance.with_joints(p) for p in postures]))
        one, other = np.array([self._places(at)[places] for at in poses]).transpose(1, 0, 2)
        gaps = one - other
        at = max(int(np.linalg.norm(gaps, axis=1).argmin()), 1)
        way = gaps[at - 1] - gaps[at]
        if np.linalg.norm(way) < STILL:
            at = len(postures) // 2
            way = gaps[at]
        way /= max(float(np.linalg.norm(way)), 1e-9)
        links = [self.stance.tree.link(self.touching(end)) for end in ends]
        return (np.array([way, -way])[:, None] @ poses[at][links][:, :3, :3])[:, 0]

    def finger_of(self, link: str) -> ModelJoint:
        """Return the joint with which the finger of a link begins at the hand."""
        path = [joint for joint in self.stance.model.path_to(link) if joint in self.limb.fingers]
        return path[0]

    def is_thumb(self, link: str) -> bool:
        """Tell whether a link belongs to a finger that is called a thumb."""
        return self.is_called(link, THUMB)

    def is_called(self, link: str, known: tuple[str, ...]) -> bool:
        """Tell whether a link belongs to a finger that is called by one of some words."""
        path = self.stance.model.path_to(link)
        names = [joint.name for joint in path if joint in self.limb.fingers]
        return any(words.has(name, known) for name in (link, *names))

    def tip(self, end: str) -> Floats:
        """Return the tip of one of ``ends``, in the root's frame, (3,) (m)."""
        return self._tips[end]

    def _outwards(self, end: str) -> Floats:
        """Return the direction from the middle of the tips to one of them, (3,)."""
        way = self._tips[end] - np.mean(list(self._tips.values()), axis=0)
        return way / max(float(np.linalg.norm(way)), 1e-9)

    def _fixed_tip(self, end: str, tip: Floats) -> Floats:
        """Return the tip of what a single jaw closes on: of the palm, its own size away."""
        joint = self.stance.model.parent_joint[end]
        root = self._poses[self.stance.tree.link(joint.child), :3, 3]
        points = self._points(self.limb.palm)
        direction = tip - root
        ahead = points[(points - root) @ direction > 0]
        return self._outermost(ahead if len(ahead) else points, root)

    def _outermost(self, points: Floats, origin: Floats) -> Floats:
        far = np.linalg.norm(points - origin, axis=1)
        return points[far >= far.max() * (1 - CAP)].mean(axis=0)

    def _points(self, link: str) -> Floats:
        """Return corners of the hulls of a link and what is rigid with it, else their origins."""
        tree = self.stance.tree
        rigid = [tree.link(name) for name in self.stance.model.rigid_with(link)]
        corners = [
            transform(self._poses[hull.link], hull.corners)
            for hull in self._hulls
            if hull.link in rigid
        ]
        return np.concatenate(corners) if corners else self._poses[rigid, :3, 3]


def find_material(model: UrdfModel, limbs: Sequence[LimbJoints]) -> GripperMaterial | None:
    """Return the contact material of all fingers, as ManiSkill's grippers have it."""
    links = tuple(link for limb in limbs if limb.fingers for link in _finger_links(model, limb))
    return GripperMaterial(links, 2.0, 2.0, 0.0, patch_radius=0.1) if links else None


def find_fingers(
    limb: LimbJoints,
    tips: Fingertips | None,
    postures: Sequence[Mapping[str, float]],
    known: tuple[str, str] | None = None,
) -> tuple[Fingers | None, str]:
    """Return the two links that grasp, if a limb has two fingers or a thumb, and why.

    Args:
        limb: The limb.
        tips: The tips of its fingers, if it has any.
        postures: Where its joints are, open first, then less and less (rad, m).
        known: The last links of the two that grasp, if they are known.
    """
    ends = known or ((tips.grasping() or tips.opposed(postures)) if tips else None)
    which = f"{limb.name} fingers".lstrip()
    if tips is None or ends is None:
        return None, Doubt(
            f"{which}: none, as {'no two tips' if limb.fingers else 'no fingers'} are found, so"
            " grasps go unnoticed; fingers=Fingers((LINK, LINK), opening_signs=(1, 1),"
            " opening_axes=(WAY, WAY)) with the links that touch, and which way each opens in its"
            " own frame, changes that"
        )
    one, other = tips.touching(ends[0]), tips.touching(ends[1])
    swings = any(
        joint.type != "prismatic"
        for end in ends
        for joint in tips.stance.model.path_to(end)
        if joint in limb.fingers
    )
    opening, axes = zip(*map(_signed_axis, tips.opening(ends, postures)), strict=True)
    fingers = Fingers(
        (one, other), opening, max_angle=WIDE if swings else Fingers.max_angle, opening_axes=axes
    )
    along = " and ".join(dict.fromkeys(map(_axis_name, axes)))
    moves = "swing" if swings else "slide"
    return fingers, f"{which}: {one} and {other} {moves} open along their {along}, as the tips part"


def _signed_axis(way: Floats) -> tuple[int, Vector3]:
    """Return sign and axis of a direction: y or another own axis that is near, else as it is."""
    for axis, near in ((1, ALONG), (0, EXACTLY), (2, EXACTLY)):
        if abs(way[axis]) >= near:
            way = np.sign(way[axis]) * np.eye(3)[axis]
    sign = 1 if way.sum() > 0 else -1
    x, y, z = (round(sign * value, 3) + 0.0 for value in way.tolist())
    return sign, (x, y, z)


def _axis_name(axis: Vector3) -> str:
    """Return ``"y axis"``, or the direction in numbers if it is along no own axis."""
    return f"{'xyz'[axis.index(1.0)]} axis" if sorted(axis) == [0.0, 0.0, 1.0] else f"{axis}"


def _finger_links(model: UrdfModel, limb: LimbJoints) -> tuple[str, ...]:
    """Return the links of a hand's fingers, with the pads that are fixed to them."""
    own = [joint.child for joint in limb.fingers]
    pads = [p for link in own for p in model.rigid_with(link)[1:] if p in model.collisions]
    return (*((limb.palm,) if len(own) == 1 else ()), *own, *pads)
