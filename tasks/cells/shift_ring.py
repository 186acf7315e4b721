"""CellShiftRing: three to eight arms in a ring pass their cubes on, all at once."""

from __future__ import annotations

from layouts import ring
from tasks import (
    BLUE,
    FACE_UP,
    GREEN,
    RED,
    TARGET_HEIGHT,
    WHITE,
    Box,
    CellTask,
    EpisodeRandom,
    Info,
    Needs,
    State,
    World,
    add_target,
    register_task,
)
from tasks.maths import Array, Floats
from tasks.originals.relay import find_zones

HALF, RADIUS, OFF = 0.02, 0.05, 0.02  # of cubes and zones, and off a zone's middle (m)
COLORS = (RED, GREEN, BLUE, WHITE)


@register_task("CellShiftRing-v1")
class CellShiftRing(CellTask):
    """Pass on all cubes at once: every arm brings the one before it to the next zone.

    Zones lie between neighbours, in reach of both. A cube lies in each, up to 2 cm off along x and
    y, turned at random.

    Success: every cube rests in the zone after its own, let go.
    """

    instruction = (
        "Pass on all cubes at once, each to the next zone.",
        "Everybody bring the cube on your left to the zone on your right.",
        "Shift the ring of cubes by one place.",
    )
    layout = ring(
        dict.fromkeys(("first", "second", "third", "fourth", "fifth", "sixth"), "panda"), radius=1.0
    )
    robot_counts = range(3, 9)
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 300
    stages = {"is_one_held": 0.1, "is_one_there": 0.4, "are_half_there": 0.7, "success": 1.0}
    viewpoint = ((1.6, 1.4, 1.6), (0.0, 0.0, 0.0))

    def build(self, world: World) -> None:
        """Add the table, and for each arm a zone and a cube."""
        super().build(world)
        for number, (arm, zone) in enumerate(zip(self.arms, find_zones(self.layout), strict=True)):
            cube = Box(half_size=(HALF, HALF, HALF), color=COLORS[number % len(COLORS)])
            world.add(f"cube_{arm}", cube, position=(*zone, HALF))
            add_target(world, RADIUS, f"zone_{arm}")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay each arm's cube into the zone before its own."""
        zones = find_zones(self.layout)
        for number, arm in enumerate(self.arms):
            world.set_pose(f"zone_{arm}", (*zones[number], TARGET_HEIGHT), FACE_UP)
            off_x, off_y = rng.uniform_between([-OFF, -OFF], [OFF, OFF]).tolist()
            x, y = zones[number - 1]
            world.set_pose(f"cube_{arm}", (x + off_x, y + off_y, HALF), rng.yaw_quaternion())

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: every cube rests in its arm's zone, let go."""
        held, done = self.held_and_left(state, {a: f"cube_{a}" for a in self.arms}, RADIUS)
        every = len(self.arms)
        return {"is_one_held": held >= 1, **self.passed(done, 1, every / 2, every)}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCPs, the cubes, and their ways to their zones."""
        parts = super().observe(state, info)
        for arm in self.arms:
            parts[f"cube_{arm}_pose"] = state.pose(f"cube_{arm}")
            parts[f"cube_{arm}_to_zone_pos"] = state.offset(f"cube_{arm}", f"zone_{arm}")
        return parts

    def ways(self, state: State) -> list[Floats]:
        """Of the cubes to their zones."""
        return [state.planar_distance(f"cube_{arm}", f"zone_{arm}") for arm in self.arms]
