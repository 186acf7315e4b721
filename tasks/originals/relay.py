"""Relay: robots in a ring pass a baton on over the table, once around."""

from __future__ import annotations

from functools import cached_property, lru_cache
from itertools import pairwise
from math import sqrt

from layouts import Layout, ring
from robots import TaskError
from tasks import (
    DARK_BLUE,
    FACE_UP,
    TARGET_HEIGHT,
    Box,
    Camera,
    EpisodeRandom,
    Info,
    MultiRobotTask,
    PhysicsSettings,
    State,
    Vector3,
    WideTable,
    World,
    add_goal,
    add_target,
    closeness,
    is_at_rest,
    register_task,
)
from tasks.maths import Array, Floats, copy, floats, minimum, norm, rounded, stack, where

# Of the baton (m): a square frame, which the tip of a stick, closed fingers or a jaw take along
# from inside, and which a gripper can also hold by a side.
INNER_HALF_WIDTH, SIDE_HALF_WIDTH, HALF_HEIGHT = 0.035, 0.008, 0.015

ZONE_RADIUS = 0.05  # m
START_OFFSET = 0.02  # of the baton from the middle of the last zone, along x and y (m)
BEACON_HEIGHT = 0.1  # over the zone that is next; twice that when all were visited (m)
WORKING_REACH = 0.65  # share of a robot's reach within which it works well
FARTHEST_REACH = 0.9  # share of a robot's reach at which a zone may be
ROBOTS = range(3, 9)


@register_task("Relay-v1")
class Relay(MultiRobotTask):
    """Slide a baton once around a ring of three to eight robots of any kind.

    Each robot's zone, where it delivers the baton, lies between it and the next robot, in reach
    of both; the last robot's lies before the first. The baton, a square frame of 8.6 cm with a
    hole for a stick, closed fingers or a jaw, starts in the last zone, up to 2 cm off along x and
    y, turned at random. A beacon floats over the zone that is next. Success: the baton has visited
    every zone in the robots' order, to within 5 cm, and rests in the last.
    """

    source = "robot-layouts; geometry and rewards are its own"
    layout = ring(
        {"first": "panda", "second": "panda_stick", "third": "panda_wristcam"}, radius=0.8
    )
    table = WideTable()
    robot_counts = ROBOTS
    physics = PhysicsSettings()
    max_episode_steps = 800
    viewpoint = ((1.5, 1.5, 1.5), (0.0, 0.0, 0.0))
    cameras = (Camera((1.2, 0.0, 1.2), (0.0, 0.0, 0.0)),)
    sensed = ("beacon_pos", "share_visited", "*_tcp_pose")

    def build(self, world: World) -> None:
        """Add the table, the baton, the zones and the beacon."""
        self.table.add_to(world, "table")
        world.add("baton", *_baton(), position=self._zones[-1])
        for robot in self.layout.arms:
            add_target(world, ZONE_RADIUS, f"zone_{robot}")
        add_goal(world, 0.02, "beacon")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the baton into the last zone, the beacon over the first."""
        for robot, (x, y, _) in zip(self.layout.arms, self._zones, strict=True):
            world.set_pose(f"zone_{robot}", (x, y, TARGET_HEIGHT), FACE_UP)
        x, y = rng.uniform_between([-START_OFFSET] * 2, [START_OFFSET] * 2).tolist()
        last_x, last_y, _ = map(rounded, self._zones[-1])
        baton = (last_x + x, last_y + y, HALF_HEIGHT)
        world.set_pose("baton", baton, rng.yaw_quaternion())
        world.set_pose("beacon", self._stations[0])

    def respond(self, state: State) -> None:
        """Move the beacon on when the baton is in its zone: so the state holds the progress."""
        visited = self._visited(state)
        away = state.position("baton") - self._next_zone(state, visited)
        arrived = (visited < len(self._zones)) & (norm(copy(away[:, :2])) <= ZONE_RADIUS)
        onward = state.array(self._stations)[minimum(visited + 1, len(self._zones))]
        self.simulation.place("beacon", onward, where=arrived)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: every zone visited, and the baton at rest in the last."""
        visited = self._visited(state)
        to_last = norm(copy((state.array(self._zones[-1]) - state.position("baton"))[:, :2]))
        rests = is_at_rest(state, "baton")
        return {
            "zones_visited": visited,
            "is_baton_at_rest": rests,
            "success": (visited == len(self._zones)) & (to_last <= ZONE_RADIUS) & rests,
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Baton and beacon, the way between them, progress, and each TCP and its way."""
        visited = info["zones_visited"]
        parts: dict[str, Array] = {
            "baton_pose": state.pose("baton"),
            "beacon_pos": state.position("beacon"),
            "baton_to_zone_pos": self._next_zone(state, visited) - state.position("baton"),
            "share_visited": floats(visited) / len(self._zones),
        }
        for robot in self._arms:
            parts[f"{robot}_tcp_pose"] = state.tcp_pose(robot)
            parts[f"{robot}_tcp_to_baton_pos"] = state.tcp_offset(robot, "baton")
        return parts

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Zones visited, and for the next its robot's reach (0.3) and the way (0.6); 1 in all."""
        visited = info["zones_visited"]
        ways = [state.tcp_distance(robot, "baton") for robot in self._arms]
        turn = minimum(visited, len(ways) - 1)
        reach, carry = closeness(
            stack(ways)[turn, state.env_ids],
            norm(self._next_zone(state, visited) - state.position("baton")),
        )
        reward = floats(visited) + 0.3 * reach + 0.6 * carry
        return where(info["success"], 1.0, reward / (len(ways) + 1))

    @cached_property
    def _arms(self) -> tuple[str, ...]:
        return tuple(self.layout.arms)

    @cached_property
    def _zones(self) -> tuple[Vector3, ...]:
        """Where the baton lies in the middle of each zone (m)."""
        return tuple((*zone, HALF_HEIGHT) for zone in find_zones(self.layout))

    @cached_property
    def _stations(self) -> tuple[Vector3, ...]:
        """Where the beacon may be (m): over the zone that is next, at last higher over the last."""
        zones = find_zones(self.layout)
        above = [(*zone, BEACON_HEIGHT) for zone in zones]
        return (*above, (*zones[-1], 2 * BEACON_HEIGHT))

    def _visited(self, state: State) -> Array:
        """How many zones the baton has visited, read off the beacon, shape (N,) int64."""
        ways = state.position("beacon")[:, None] - state.array(self._stations)
        squares = ways * ways
        return (squares[:, :, 0] + squares[:, :, 1] + squares[:, :, 2]).argmin(1)

    def _next_zone(self, state: State, visited: Array) -> Floats:
        """Where the baton is to go, shape (N, 3) (m)."""
        return state.array(self._zones)[minimum(visited, len(self._zones) - 1)]


def _baton() -> list[Box]:
    """The four sides of the frame."""
    middle, long = INNER_HALF_WIDTH + SIDE_HALF_WIDTH, INNER_HALF_WIDTH + 2 * SIDE_HALF_WIDTH
    along_x, along_y = (long, SIDE_HALF_WIDTH), (SIDE_HALF_WIDTH, INNER_HALF_WIDTH)
    return [
        Box(half_size=(*size, HALF_HEIGHT), position=(x, y, 0.0), color=DARK_BLUE)
        for size, x, y in (
            (along_x, 0.0, middle),
            (along_x, 0.0, -middle),
            (along_y, middle, 0.0),
            (along_y, -middle, 0.0),
        )
    ]


@lru_cache
def find_zones(layout: Layout) -> tuple[tuple[float, float], ...]:
    """Return the middle of each robot's zone, x and y (m, world), in the robots' order.

    A zone is at the same share of the reach of its robot and of the next one: at
    `WORKING_REACH` on the side of the ring's middle, or where the two bases are farther apart than
    that, on the line between them.

    Raises:
        TaskError: If neighbours are so far apart, or of so different reach and so near, that no
            such place is in reach of both.
    """
    arms = layout.arms
    names = list(arms)
    bases = [placement.base_position[:2] for placement in arms.values()]
    middle_x, middle_y = (sum(along) / len(bases) for along in zip(*bases, strict=True))
    zones: list[tuple[float, float]] = []
    for i, j in pairwise([*range(len(names)), 0]):
        first, second = (arms[names[k]].robot.reach for k in (i, j))
        (x, y), (end_x, end_y) = bases[i], bases[j]
        way_x, way_y = end_x - x, end_y - y
        apart = sqrt(way_x * way_x + way_y * way_y)
        share = max(WORKING_REACH, apart / (first + second))
        near, far = share * first, share * second
        if share > FARTHEST_REACH or apart <= abs(near - far):
            raise TaskError(
                f"the robots {names[i]!r} and {names[j]!r} stand {apart:.2f} m apart and reach"
                f" {first} m and {second} m; they can pass something on from"
                f" {WORKING_REACH * abs(first - second):.2f} m to"
                f" {FARTHEST_REACH * (first + second):.2f} m. Move them, or leave it to"
                " layouts.ring(…, radius='auto')"
            )
        along = (apart**2 + near**2 - far**2) / (2 * apart)
        aside = sqrt(max(near**2 - along**2, 0.0))
        ahead_x, ahead_y = way_x / apart, way_y / apart
        if ahead_x * (middle_y - y) < ahead_y * (middle_x - x):  # the middle is to the right
            aside = -aside
        zone = (x + along * ahead_x - aside * ahead_y, y + along * ahead_y + aside * ahead_x)
        zones.append(zone)
    return tuple(zones)
