"""FourRobotStack: four arms around a table stack their cubes at its middle, in order."""

from __future__ import annotations

from layouts import around_table
from tasks import (
    BLUE,
    FACE_UP,
    GREEN,
    RED,
    TARGET_HEIGHT,
    Camera,
    Color,
    Cube,
    EpisodeRandom,
    Info,
    MultiRobotTask,
    Needs,
    PhysicsSettings,
    State,
    Target,
    WideTable,
    World,
    closeness,
    diagonal,
    is_at_rest,
    lies_on,
    register_task,
)
from tasks.maths import Array, Flags, Floats, norm, stack, where

# m; the arms stand 0.78 m from the middle
CUBE_HALF_SIZE = 0.02
SPAWN_LOW, SPAWN_HIGH = (0.25, -0.08), (0.33, 0.08)  # from the middle towards the arm, and aside
GOAL_RADIUS = 0.03
TOLERANCE = 0.005  # beyond half a cube's diagonal

YELLOW: Color = (1.0, 0.8, 0.0, 1.0)
# Who puts which cube, from the bottom up: the way from the middle to its side of the table.
ORDER = {"south": (0.0, -1.0), "east": (1.0, 0.0), "north": (0.0, 1.0), "west": (-1.0, 0.0)}


@register_task("FourRobotStack-v1")
class FourRobotStack(MultiRobotTask):
    """Stack four cubes at the middle of a table: south's, then east's, north's and west's.

    Each cube lies before its arm, 0.25 to 0.33 m from the middle and up to 0.08 m aside, turned
    at random. Success: the lowest cube is within 3 cm of the middle, each other one lies on the
    one before to within half a cube, all are at rest, and no arm holds any.
    """

    source = "robot-layouts; geometry and rewards are its own"
    layout = around_table(dict.fromkeys(ORDER, "panda"), edges=tuple(ORDER), table=(1.76, 1.76))
    needs = {"*": Needs(fingers=True, opening=2 * CUBE_HALF_SIZE)}
    physics = PhysicsSettings()
    max_episode_steps = 300
    max_reward = 5
    viewpoint = ((1.3, 1.0, 1.0), (0.0, 0.0, 0.1))
    cameras = (Camera((0.6, 0.6, 0.8), (0.0, 0.0, 0.1)),)

    table = WideTable()
    cube_south = Cube(CUBE_HALF_SIZE, RED, start=(0.0, -SPAWN_LOW[0], CUBE_HALF_SIZE))
    cube_east = Cube(CUBE_HALF_SIZE, GREEN, start=(SPAWN_LOW[0], 0.0, CUBE_HALF_SIZE))
    cube_north = Cube(CUBE_HALF_SIZE, BLUE, start=(0.0, SPAWN_LOW[0], CUBE_HALF_SIZE))
    cube_west = Cube(CUBE_HALF_SIZE, YELLOW, start=(-SPAWN_LOW[0], 0.0, CUBE_HALF_SIZE))
    goal_region = Target(GOAL_RADIUS)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay a cube before each arm."""
        world.set_pose("goal_region", (0.0, 0.0, TARGET_HEIGHT), FACE_UP)
        for place, (x, y) in ORDER.items():
            out, aside = rng.uniform_between(SPAWN_LOW, SPAWN_HIGH).tolist()
            position = (out * x - aside * y, out * y + aside * x, CUBE_HALF_SIZE)
            world.set_pose(f"cube_{place}", position, rng.yaw_quaternion())

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: stacked in order at the middle, at rest and let go."""
        info: dict[str, Array] = {}
        below: str | None = None
        done = state.full(True)
        for place in ORDER:
            grasped = state.is_grasping(place, f"cube_{place}")
            done = done & _lies_in_place(state, place, below)
            info |= {f"is_{place}_grasping": grasped, f"is_{place}_placed": done & ~grasped}
            below = place
        success = done
        for place in ORDER:
            success = success & info[f"is_{place}_placed"] & is_at_rest(state, f"cube_{place}")
        return {**info, "success": success}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Of each arm: TCP, cube, the way between them and the cube's to its place."""
        parts: dict[str, Array] = {}
        for level, place in enumerate(ORDER):
            cube = f"cube_{place}"
            parts[f"{place}_tcp_pose"] = state.tcp_pose(place)
            parts[f"{cube}_pose"] = state.pose(cube)
            parts[f"{place}_tcp_to_cube_pos"] = state.tcp_offset(place, cube)
            parts[f"{cube}_to_place_pos"] = state.array(_PLACES[level]) - state.position(cube)
            parts[f"is_{place}_grasping"] = info[f"is_{place}_grasping"]
        return parts

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """For each arm reach (0.2), grasp (0.3) and carry (0.9), 1 when placed; 5 on success."""
        cubes = {place: f"cube_{place}" for place in ORDER}
        to_cube = [state.tcp_distance(place, cube) for place, cube in cubes.items()]
        positions = stack([state.position(cube) for cube in cubes.values()])
        astray = norm(state.array(_PLACES)[:, None] - positions)
        terms = closeness(*to_cube, *astray)
        reach, carry = stack(terms[: len(ORDER)]), stack(terms[len(ORDER) :])
        grasped = stack([info[f"is_{place}_grasping"] for place in ORDER])
        placed = stack([info[f"is_{place}_placed"] for place in ORDER])
        parts = where(placed, 1.0, where(grasped, 0.3 + 0.6 * carry, 0.2 * reach))
        return where(info["success"], 5.0, sum(parts))


def _lies_in_place(state: State, place: str, below: str | None) -> Flags:
    """Whether a cube lies on the one below it, the lowest one at the middle, shape (N,) bool."""
    cube = f"cube_{place}"
    if below is not None:
        return lies_on(state, cube, f"cube_{below}", _ASIDE, 2 * CUBE_HALF_SIZE)
    return state.planar_distance(cube, "goal_region") <= GOAL_RADIUS


_ASIDE = diagonal(CUBE_HALF_SIZE, TOLERANCE)
_PLACES = tuple((0.0, 0.0, (2 * i + 1) * CUBE_HALF_SIZE) for i in range(len(ORDER)))
