"""CellPassAround: three to eight arms in a ring hand one cube on, from zone to zone."""

from __future__ import annotations

from layouts import ring
from tasks import (
    FACE_UP,
    RED,
    TARGET_HEIGHT,
    CellTask,
    Cube,
    EpisodeRandom,
    Needs,
    State,
    World,
    add_target,
    register_task,
)
from tasks.maths import Array, Flags, Floats, maximum
from tasks.originals.relay import find_zones

HALF, RADIUS, OFF, HEIGHT = 0.02, 0.05, 0.02, 0.1  # m


@register_task("CellPassAround-v1")
class CellPassAround(CellTask):
    """Hand the cube on around the ring, from zone to zone, until the last arm holds it up.

    Zones lie between neighbours, in reach of both. The cube lies before the first arm, up to 2 cm
    off along x and y, turned at random.

    Success: the last arm holds the cube 10 cm above the table.
    """

    instruction = (
        "Hand the cube on around the ring; the last one holds it up.",
        "Pass the cube from arm to arm, and let the last lift it.",
        "Bring the cube around, each to the next zone.",
    )
    layout = ring(
        {"first": "panda", "second": "panda_wristcam", "third": "panda", "fourth": "panda"},
        radius=0.95,
    )
    robot_counts = range(3, 9)
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 700
    stages = {"is_taken": 0.1, "is_first_done": 0.4, "is_before_last": 0.7, "success": 1.0}
    viewpoint = ((1.5, 1.3, 1.4), (0.0, 0.0, 0.0))

    cube = Cube(HALF, RED)

    def build(self, world: World) -> None:
        """Add table, cube and zones."""
        super().build(world)
        for arm in self.arms:
            add_target(world, RADIUS, f"zone_{arm}")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the cube into the zone before the first arm."""
        for arm, zone in zip(self.arms, find_zones(self.layout), strict=True):
            world.set_pose(f"zone_{arm}", (*zone, TARGET_HEIGHT), FACE_UP)
        x, y = find_zones(self.layout)[-1]
        off_x, off_y = rng.uniform_between([-OFF, -OFF], [OFF, OFF]).tolist()
        world.set_pose("cube", (x + off_x, y + off_y, HALF), rng.yaw_quaternion())

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: held up by the last arm."""
        high = state.position("cube")[:, 2] >= HEIGHT
        return {
            "is_taken": state.is_grasping(self.arms[0], "cube"),
            "is_first_done": self._is_in(state, self.arms[0]),
            "is_before_last": self._is_in(state, self.arms[-2]),
            "success": high & state.is_grasping(self.arms[-1], "cube"),
        }

    def ways(self, state: State) -> list[Floats]:
        """How far the cube is from the zones on its way, and of the last hand to it, upwards."""
        last = state.tcp_distance(self.arms[-1], "cube")
        high = maximum(HEIGHT - state.position("cube")[:, 2], 0.0)
        return [state.planar_distance("cube", f"zone_{self.arms[-2]}"), last, high]

    def _is_in(self, state: State, arm: str) -> Flags:
        low = state.position("cube")[:, 2] <= HALF + 0.005
        return low & (state.planar_distance("cube", f"zone_{arm}") <= RADIUS)
