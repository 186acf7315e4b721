"""CellSwapPlaces: three arms swap two cubes over a third place, by turns."""

from __future__ import annotations

from layouts import ring
from tasks import (
    BLUE,
    RED,
    CellTask,
    Cube,
    EpisodeRandom,
    Info,
    Needs,
    State,
    Target,
    World,
    is_at_rest,
    register_task,
)
from tasks.maths import Array, Floats, norm

HALF, RADIUS, OFF, AWAY = 0.02, 0.05, 0.02, 0.2  # m; AWAY: of a cube that is no longer at its place
CUBES = ("red", "blue")
PLACES = ((0.173, -0.1), (0.0, 0.2), (-0.173, -0.1))  # each after its arm, counterclockwise (m)


@register_task("CellSwapPlaces-v1")
class CellSwapPlaces(CellTask):
    """Swap the cubes: each comes to lie where the other one was.

    Three places lie between neighbours, in reach of these two only. The cubes lie on two of them,
    drawn, up to 2 cm off along x and y, turned at random; the third is free.

    Success: each cube rests within 5 cm of where the other one began, let go.
    """

    instruction = ("Swap the cubes.", "Exchange red and blue.", "Lay each where the other one is.")
    layout = ring({"south": "panda", "east": "franka_panda", "west": "panda_wristcam"}, radius=0.75)
    needs = {"*": Needs(fingers=True, opening=2 * HALF)}
    max_episode_steps = 350
    stages = {"is_one_held": 0.1, "is_red_away": 0.3, "is_blue_there": 0.6, "success": 1.0}
    viewpoint = ((0.0, 1.5, 1.2), (0.0, 0.0, 0.0))

    place_south = place_east = place_west = Target(RADIUS)
    red, blue = Cube(HALF, RED), Cube(HALF, BLUE)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the places down, and the cubes on two of them."""
        free = int(3 * rng.uniform(1).item())
        flat, lying = self.place_south.height, self.place_south.lying
        for arm, place in zip(self.arms, PLACES, strict=True):
            world.set_pose(f"place_{arm}", (*place, flat), lying)
        for cube, number in (("red", free + 1), ("blue", free + 2)):
            x, y = PLACES[number % 3]
            off_x, off_y = rng.uniform_between([-OFF, -OFF], [OFF, OFF]).tolist()
            world.set_pose(cube, (x + off_x, y + off_y, HALF), rng.yaw_quaternion())

    def remember(self, state: State) -> dict[str, Array]:
        """Where each cube is to come: to where the other one began."""
        return {"red": state.position("blue"), "blue": state.position("red")}

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: both have changed places."""
        held = self.count([state.is_grasping(arm, cube) for arm in self.arms for cube in CUBES])
        red, blue = (way <= RADIUS for way in self.ways(state))
        rests = self.count([is_at_rest(state, cube) for cube in CUBES]) >= 2
        return {
            "is_one_held": held >= 1,
            "is_red_away": norm(state.position("red") - self.memory.blue) >= AWAY,
            "is_blue_there": blue & is_at_rest(state, "blue"),
            "success": red & blue & rests & (held < 1),
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCPs and bodies, and where the cubes are to come."""
        goals = {f"{cube}_goal_pos": getattr(self.memory, cube) for cube in CUBES}
        return {**super().observe(state, info), **goals}

    def ways(self, state: State) -> list[Floats]:
        """Of the cubes to where the other one began."""
        return [norm(state.position(cube) - getattr(self.memory, cube)) for cube in CUBES]
