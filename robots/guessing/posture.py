"""A posture to stand in: in front of the robot, off the ground, and free of self-collision."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robot_layouts.kinematics.rotations import Floats
from robots.bodies.hulls import Hull
from robots.bodies.overlaps import overlapping
from robots.guessing.anatomy import LimbJoints, flies
from robots.guessing.doubt import Doubt
from robots.guessing.stance import Stance
from robots.guessing.tool import Tool
from robots.urdf.model import ModelJoint

MARGIN = 0.1  # of a joint's range, which it stays away from its ends
DRAWS = 1500  # random postures of a limb
BEST = 16  # of them, refined and then looked at for overlaps
TRIES = 3  # rounds of that, each without the overlaps met before
ROUNDS = 4  # of refinement, each with half the spread
ROOM = 0.15  # rad, of each joint, in which nothing may overlap either
ROOM_TRIES = 6  # random motions of all joints by so much, besides those of one alone
SHAKEN = 0.06  # rad; the same of a posture that is known: three times what resets draw
BEHIND = 0.1  # of the reach; how far behind the limb a TCP may be in a posture that is known
OFF = 0.05  # of a joint's range; how far it stands off its stops at least
OUT = 0.55  # of the reach; where the TCP is best, ahead of the limb's first joint
NEAR, FAR = 0.35, 0.85  # of the reach; where it may be
HEIGHT = 0.35  # of the reach, above the ground; best for an arm that stands on it
HANGING = -0.25  # of the reach, below the shoulder; best for an arm on a body
LOW = 0.02  # m above the ground; the least of any moving link
PLAIN = 0.5  # weight of joints that leave the posture that the search starts from
DOWN = 0.15  # weight of a tool that does not point down
ONE_SIDED = 0.25  # of the reach; how far aside the middle of a workspace tells a front
QUARTER = np.pi / 2  # rad; to which the front is rounded, or to half of it
NEARLY = 0.6  # rad; how near it must be to a quarter turn
BESIDE = 0.35  # of the reach; how far the TCP may be to the side of what is ahead


class LimbView:
    """One limb: where its joints may be, and where they bring its TCP.

    Attributes:
        free: Indices of its joints among the leading ones.
        limits: Lower and upper limits of those, (2, free) (rad, m).
        room: The same without the margin at the ends.
        bounded: Whether each of them turns less than a whole turn, or slides.
        slides: Whether each of them slides.
        reach: How far the TCP gets from the shoulder (m).
        shoulder: Where the first of them is, (3,) (m).
        moving: Indices of the links that move, in the smaller tree.
        links: Indices of all links that it moves, in the robot's tree.
    """

    def __init__(self, stance: Stance, limb: LimbJoints, tool: Tool) -> None:
        """Take a limb with a joint of its own, and its tool centre point."""
        joints = [joint for joint in limb.arm if joint.mimics is None]
        self.free = [stance.index[joint.name] for joint in joints]
        spans = np.array([joint.span for joint in joints]).T
        self.bounded = spans[1] - spans[0] < 2 * np.pi - 0.1
        half = np.where(self.bounded, (spans[1] - spans[0]) / 2, np.pi)
        middle = np.where(self.bounded, spans.mean(axis=0), np.clip(0.0, *spans))
        self.limits = np.array([middle - half, middle + half])
        self.slides = np.array([joint.unit == "m" for joint in joints])
        margin = 1.5 * MARGIN * half * 2
        self.room = self.limits + np.array([margin, -margin])
        links = [*tool.on(stance.tree).needed, stance.tree.link(limb.palm)]
        self._tree = stance.tree.towards(links)
        self._tcp = tool.on(self._tree)
        self._palm = self._tree.link(limb.palm)
        first = self._tree.link(joints[0].child)
        pose = stance.poses(stance.middle)[0, stance.tree.link(joints[0].child)]
        self.shoulder: Floats = pose[:3, 3]
        axis = pose[:3, :3] @ self._tree.axes[first]
        self.is_upright = abs(axis[2]) > 0.9 and not self._tree.slides[first]
        self.moving = [i for i in range(len(self._tree.links)) if i > first]
        self.links = frozenset(
            stance.tree.link(link)
            for joint in stance.model.below(joints[0])
            for link in stance.model.rigid_with(joint.child)
        )
        self.reach = 1.0

    def look(self, postures: Floats) -> tuple[Floats, Floats]:
        """Return the poses of the limb's links, and the TCP from the shoulder (postures, 3)."""
        poses = self._tree.forward(postures)
        return poses, self._tcp.places(poses) - self.shoulder

    def places(self, postures: Floats) -> Floats:
        """Return the TCP from the shoulder, (postures, 3) (m)."""
        return self.look(postures)[1]

    def pointing(self, poses: Floats) -> Floats:
        """Return which way the tool points, seen from the palm, (postures, 3); 0 if nowhere."""
        way = self._tcp.places(poses) - poses[:, self._palm, :3, 3]
        length = np.linalg.norm(way, axis=1, keepdims=True)
        return np.where(length > 0.01, way / np.maximum(length, 1e-9), 0.0)


@dataclass(frozen=True)
class Posture:
    """A posture to stand in.

    Attributes:
        position: Of the leading joints, in the order of the stance's (rad, m).
        overlapping: Pairs of links that overlap in it all the same.
        reasons: One sentence each.
    """

    position: Floats
    overlapping: tuple[tuple[str, str], ...]
    reasons: tuple[str, ...]


class PostureSearch:
    """The search for the posture of one robot; the same robot gets the same one every time."""

    def __init__(
        self,
        stance: Stance,
        tools: Sequence[tuple[LimbJoints, Tool]],
        hulls: Sequence[Hull],
        pairs: Sequence[tuple[int, int]],
        hands: Sequence[Sequence[Mapping[str, float]]],
        torso: Sequence[ModelJoint],
    ) -> None:
        """Take a robot.

        Args:
            stance: The robot.
            tools: Its limbs and their tool centre points.
            hulls: Its convex bodies; empty if they cannot be read.
            pairs: Indices of hulls that may not overlap.
            hands: Of each hand where its joints may stand, the best first (rad, m).
            torso: Joints that carry limbs.
        """
        self._stance, self._hulls, self._pairs = stance, hulls, np.array(pairs, int).reshape(-1, 2)
        self._start = self._posed = self._opened(hands)
        self._hands = {joint for choices in hands for joint in choices[0]}
        self._front = np.array([1.0, 0.0, 0.0])
        self._generator = np.random.default_rng(0)
        self._torso = torso
        self._views = [LimbView(stance, limb, tool) for limb, tool in tools if _searchable(limb)]
        self._ground = self._lowest()

    def given(self, joints: Mapping[str, float], where: str) -> Posture:
        """Return a posture that is known, with the hands open, or a better one if it is no good.

        It is no good if links overlap, in it or with a little noise, or a TCP is behind its limb.

        Args:
            joints: Where joints are (rad, m); the others stay where the search starts.
            where: What says so, for the reason.
        """
        known = {
            leader.name: min(max(joints[leader.name], leader.span[0]), leader.span[1])
            for leader in self._stance.leaders
            if leader.name in joints and leader.name not in self._hands
        }
        about = f"{where}, the hands open" if self._hands else where
        posture = self._stance.with_joints(known, self._start)
        why = self._objection(posture)
        if not why:
            return self._made(posture, about)
        found = self.run()
        if self._left(found.position) > self._left(posture):
            return self._made(posture, about)
        instead = Doubt(f"keyframe 'rest' is not {where}: {why}")
        return replace(found, reasons=(*found.reasons, instead))

    def _objection(self, posture: Floats) -> str:
        """Return why one should not start in a posture, or nothing."""
        if self._left(posture):
            return "links overlap in it"
        if any(self._near(view, posture, self._pairs, SHAKEN) for view in self._views):
            return f"links overlap within {SHAKEN:g} rad of it"
        self._look(posture, [self._draw(view, posture) for view in self._views])
        if any(self._is_behind(view, posture) for view in self._views):
            return "the TCP is behind the limb in it"
        return ""

    def _is_behind(self, view: LimbView, posture: Floats) -> bool:
        """Tell whether a TCP is behind its shoulder, however a first upright joint is turned."""
        turned = posture.copy()
        if len(self._views) == 1 and view.is_upright:
            turned[view.free[0]] = view.limits[:, 0].mean()
        return float(view.places(turned[None])[0] @ self._front) < -BEHIND * view.reach

    def run(self) -> Posture:
        """Return the posture with all joints at 0 or mid-range if it is fine, else a better one."""
        posture = self._start
        if not self._views:
            return self._made(posture, "joints at 0, or mid-range where 0 is out")
        samples = [self._draw(view, posture) for view in self._views]
        self._look(posture, samples)
        front = _as_text(self._front)
        if not self._left(posture) and self._is_fine(posture):
            return self._made(
                posture,
                "joints at 0, or mid-range where 0 is out, the gripper open; no links overlap, and"
                f" the TCP is ahead, towards {front}",
            )
        posture = min((self._searched(start, samples) for start in self._starts()), key=self._left)
        return self._made(
            posture,
            "from a search, as with the joints at 0 or mid-range links overlap, or the TCP is not"
            f" well ahead of the robot; it is now, towards {front}, where the workspace lies; the"
            " gripper is open",
        )

    def _made(self, position: Floats, about: str) -> Posture:
        """Return a posture, off the joints' stops, with what overlaps in it and the reason."""
        off = self._off_stops(position)
        if not np.array_equal(off, position) and self._left(off) <= self._left(position):
            position, about = off, f"{about}; joints that stood at a stop are off it"
        links = [self._stance.tree.links[hull.link] for hull in self._hulls]
        left = self._pairs[self._overlaps(position, self._pairs)]
        pairs = tuple(dict.fromkeys((links[a], links[b]) for a, b in left.tolist()))
        reasons = [f"keyframe 'rest': {about}"]
        if pairs:
            listing = ", ".join(f"{one} and {other}" for one, other in pairs)
            overlaps = f"allowed_collisions, too: {listing}, which overlap in that posture"
            reasons.append(Doubt(overlaps))
        return Posture(position, pairs, tuple(reasons))

    def _off_stops(self, position: Floats) -> Floats:
        """Return a posture in which an action moves every joint of an arm both ways."""
        moved = position.copy()
        for view in self._views:
            low, high = view.limits[:, view.bounded]
            some = np.array(view.free)[view.bounded]
            margin = OFF * (high - low)
            moved[some] = np.clip(position[some], low + margin, high - margin)
        return moved

    def _starts(self) -> Iterator[Floats]:
        """Yield the postures to search from: as it stands, and with its torso half-way up."""
        yield self._start
        lifts = [joint for joint in self._torso if joint.unit == "m" and joint.mimics is None]
        if lifts and self._left(self._posed) > 0:
            yield self._stance.with_joints({j.name: sum(j.span) / 2 for j in lifts}, self._start)

    def _left(self, posture: Floats) -> int:
        return int(self._overlaps(posture, self._pairs).sum())

    def _searched(self, posture: Floats, samples: Sequence[Floats]) -> Floats:
        """Return a posture with one limb after the other at its best."""
        waiting = [view.links for view in self._views]
        for view, drawn in zip(self._views, samples, strict=True):
            waiting.pop(0)
            pairs = self._pairs[self._touching(view.links, frozenset().union(*waiting))]
            posture = self._best(view, posture, drawn, pairs)
        self._posed = posture
        return posture

    def _touching(self, links: frozenset[int], apart: frozenset[int]) -> NDArray[np.bool_]:
        """Tell of which pairs one hull is on some links, and none on others, (pairs,)."""
        sides = [{self._hulls[i].link for i in pair} for pair in self._pairs]
        return np.array([bool(links & pair) and not apart & pair for pair in sides], bool)

    def _opened(self, hands: Sequence[Sequence[Mapping[str, float]]]) -> Floats:
        """Return the middle posture with every hand as open as it can be without overlaps."""
        posture = self._stance.middle
        for choices in hands:
            made = [self._stance.with_joints(choice, posture) for choice in choices]
            hand = self._links(choices[0])
            inside = np.array(
                [[self._hulls[i].link in hand for i in pair] for pair in self._pairs], bool
            ).reshape(-1, 2)
            pairs = self._pairs[inside.all(axis=1)]
            counts = [int(self._overlaps(tried, pairs).sum()) for tried in made]
            posture = made[counts.index(min(counts))]
        return posture

    def _links(self, joints: Mapping[str, float]) -> frozenset[int]:
        """Return the links that some joints join, and what is rigid with them."""
        model, tree = self._stance.model, self._stance.tree
        ends = [end for j in model.moving if j.name in joints for end in (j.parent, j.child)]
        return frozenset(tree.link(link) for end in ends for link in model.rigid_with(end))

    def _lowest(self) -> float:
        """Return the height of the ground: of the lowest point of the root's body (m)."""
        heights = self._stance.poses(self._stance.middle)[0, :, 2, 3]
        body = [
            float(hull.corners[:, 2].min() + heights[hull.link])
            for hull in self._hulls
            if self._stance.tree.bodies[hull.link] == 0
        ]
        return min([0.0, *body])

    def _draw(self, view: LimbView, posture: Floats) -> Floats:
        drawn = np.tile(posture, (DRAWS, 1))
        low, high = view.room
        drawn[:, view.free] = self._generator.uniform(low, high, (DRAWS, len(view.free)))
        return drawn

    def _look(self, posture: Floats, samples: Sequence[Floats]) -> None:
        """Tell which way is front: where the limbs' workspaces lie, seen from their shoulders.

        A limb whose first joint turns about the vertical reaches all around; it looks where it
        does with that joint in the middle of its range.
        """
        ahead = np.zeros(3)
        for view, drawn in zip(self._views, samples, strict=True):
            turned = drawn.copy()
            turned[:, view.free[0]] = view.limits[:, 0].mean()
            seen = drawn if len(self._views) > 1 or not view.is_upright else turned
            places = view.places(seen)
            view.reach = float(np.quantile(np.linalg.norm(places, axis=1), 0.98))
            ahead += places.mean(axis=0)
        ahead[2] = 0.0
        total = sum(view.reach for view in self._views)
        if np.linalg.norm(ahead) < ONE_SIDED * total:  # all around: then as it stands
            ahead = sum((view.places(posture[None])[0] for view in self._views), np.zeros(3))
            ahead[2] = 0.0
        clear = np.linalg.norm(ahead) >= ONE_SIDED * total
        angle = np.arctan2(ahead[1], ahead[0]) if clear else 0.0
        quarter = np.round(angle / QUARTER) * QUARTER
        eighth = np.round(angle / QUARTER * 2) * QUARTER / 2
        angle = quarter if abs(angle - quarter) < NEARLY else eighth
        self._front = np.array([np.cos(angle), np.sin(angle), 0.0])

    def _is_fine(self, posture: Floats) -> bool:
        return all(
            np.isfinite(self._cost(view, posture[None], strict=True)[0]) for view in self._views
        )

    def _cost(self, view: LimbView, postures: Floats, *, strict: bool = False) -> Floats:
        """Return how bad postures are, (postures,); infinite where they are no good at all."""
        poses, place = view.look(postures)
        out = place @ self._front / view.reach
        aside = np.abs(place @ np.array([-self._front[1], self._front[0], 0.0])) / view.reach
        far = np.linalg.norm(place, axis=1) / view.reach
        up = view.shoulder[2] - self._ground
        stands = up < 0.6 * view.reach
        height = (place[:, 2] + (up if stands else 0.0)) / view.reach
        wanted = HEIGHT if stands else HANGING
        low, high = view.limits
        at = (postures[:, view.free] - (low + high) / 2) / (high - low) * 2
        away = (postures[:, view.free] - self._start[view.free]) / (high - low) * 2
        cost = (out - OUT) ** 2 + aside**2 + (height - wanted) ** 2
        cost += PLAIN * (away**2).mean(axis=1)
        cost += DOWN * (1 + view.pointing(poses)[:, 2]) / 2
        bad = (far < NEAR) | (far > FAR) | (out < 0.8 * NEAR) | (aside > BESIDE)
        bad |= poses[:, view.moving, 2, 3].min(axis=1) < self._ground + LOW
        if strict:
            bad |= (np.abs(at[:, view.bounded]) > 1 - MARGIN).any(axis=1)
        return np.where(bad, np.inf if strict else cost + 10.0, cost)

    def _best(
        self, view: LimbView, posture: Floats, drawn: Floats, pairs: NDArray[np.intp]
    ) -> Floats:
        """Return the best posture of one limb that overlaps nothing, else the one that does least.

        Each round leaves out the postures with overlaps that the last round met.
        """
        drawn, near = drawn.copy(), DRAWS // 2
        pulled = (drawn[:near, view.free] + self._start[view.free]) / 2
        drawn[:near, view.free] = np.clip(pulled, *view.room)
        fixed = np.delete(np.arange(len(posture)), view.free)
        drawn[:, fixed] = posture[fixed]
        counts: list[tuple[int, int, int, Floats]] = []
        met = np.zeros(len(pairs), bool)
        for _ in range(TRIES):
            pool = self._refined(view, self._without(pairs[met], drawn, view))
            for tried in pool:
                overlaps = self._overlaps(tried, pairs)
                near = 0 if overlaps.any() else self._near(view, tried, pairs)
                if not (overlaps.any() or near):
                    return tried
                met |= overlaps
                counts.append((int(overlaps.sum()), near, len(counts), tried))
        return min(counts)[3]

    def _near(
        self, view: LimbView, posture: Floats, pairs: NDArray[np.intp], room: float = ROOM
    ) -> int:
        """Return how many of some small motions of a limb make something overlap."""
        count = len(view.free)
        together = np.random.default_rng(0).choice([-room, room], (ROOM_TRIES, count))
        moves = np.concatenate([together, room * np.eye(count), -room * np.eye(count)])
        moved = np.tile(posture, (len(moves), 1))
        moved[:, view.free] += np.where(view.slides, moves * room, moves)
        return sum(self._any(poses, pairs) for poses in self._stance.poses(moved))

    def _without(self, pairs: NDArray[np.intp], drawn: Floats, view: LimbView) -> Floats:
        """Return the best of some postures in which some pairs do not overlap, or all if none."""
        order = np.argsort(self._cost(view, drawn), kind="stable")[: DRAWS // 4]
        if not len(pairs):
            return drawn
        poses = self._stance.poses(drawn[order])
        free = [i for i, at in zip(order, poses, strict=True) if not self._any(at, pairs)]
        return drawn[free] if free else drawn

    def _refined(self, view: LimbView, drawn: Floats) -> Floats:
        low, high = view.room
        pool = drawn[np.argsort(self._cost(view, drawn), kind="stable")[:BEST]]
        spread = 0.15 * (high - low)
        for _ in range(ROUNDS):
            shape = (len(pool), 8, len(view.free))
            noise = self._generator.normal(0.0, 1.0, shape) * spread
            tried = np.repeat(pool[:, None], 8, axis=1)
            tried[..., view.free] = np.clip(tried[..., view.free] + noise, low, high)
            family = np.concatenate([pool[:, None], tried], axis=1)
            cost = self._cost(view, family.reshape(-1, drawn.shape[1])).reshape(family.shape[:2])
            pool = family[np.arange(len(pool)), cost.argmin(axis=1)]
            spread = spread / 2
        return pool[np.argsort(self._cost(view, pool), kind="stable")]

    def _any(self, poses: Floats, pairs: NDArray[np.intp]) -> bool:
        """Tell whether anything overlaps where the links have some poses, (links, 4, 4)."""
        return len(pairs) > 0 and any(overlapping(self._hulls, poses, pairs))

    def _overlaps(self, posture: Floats, pairs: NDArray[np.intp]) -> NDArray[np.bool_]:
        if not len(pairs):
            return np.zeros(0, bool)
        return np.asarray(overlapping(self._hulls, self._stance.poses(posture)[0], pairs), bool)


def _searchable(limb: LimbJoints) -> bool:
    """Tell whether a limb has an arm of its own, which stands somewhere."""
    own = [joint for joint in limb.arm if joint.mimics is None]
    return len(own) > 1 and not any(map(flies, limb.arm))


def _as_text(direction: Floats) -> str:
    angle = round(float(np.degrees(np.arctan2(direction[1], direction[0]))))
    names = {0: "+x", 90: "+y", 180: "-x", -180: "-x", -90: "-y"}
    return names.get(angle, f"{angle} degrees from +x")
