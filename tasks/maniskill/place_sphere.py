"""PlaceSphere: put a ball into a shallow bin and let go of it."""

from __future__ import annotations

from layouts import single
from tasks import (
    DARK_BLUE,
    WHITE,
    Ball,
    Box,
    Camera,
    Compound,
    EpisodeRandom,
    Info,
    PhysicsSettings,
    State,
    World,
    closeness,
    distance_to_top,
    is_at_rest,
    letting_go,
    lies_on,
    register_task,
    stillness,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Floats, where

# mani_skill 3.0.1, envs/tasks/tabletop/place_sphere.py (m)
RADIUS = 0.02
WALL = 0.0025  # half the thickness of the bin's floor and walls; the walls are twice as high
BIN_HALF_SIZE = 0.02 + 2 * WALL  # outside
TOLERANCE = 0.005  # between the origins of ball and bin, seen from above
STATIC_SPEED = 0.2  # rad/s


def bin_shapes() -> tuple[Box, ...]:
    """Return the bin's floor and its walls at -x, +x, -y, +y; the floor's centre is the origin."""
    across, height = BIN_HALF_SIZE - WALL, 2 * WALL + WALL
    floor = Box(half_size=(BIN_HALF_SIZE, BIN_HALF_SIZE, WALL), color=WHITE)
    return (
        floor,
        *(
            Box(half_size=(WALL, BIN_HALF_SIZE, 2 * WALL), position=(x, 0.0, height), color=WHITE)
            for x in (-across, across)
        ),
        *(
            Box(half_size=(BIN_HALF_SIZE, WALL, 2 * WALL), position=(0.0, y, height), color=WHITE)
            for y in (-across, across)
        ),
    )


@register_task("PlaceSphere-v1", "maniskill.place_sphere_native")
class PlaceSphere(Clone):
    """Put a ball into a shallow bin that does not move, and let go of it.

    The ball lies at x in [-0.1, -0.05], the bin at x in [0, 0.1], both with y in [-0.1, 0.1] (m).
    Success: the ball lies in the bin, at rest, and is not grasped.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/place_sphere.py"
    layout = single({"arm": "panda"})
    physics = PhysicsSettings()
    max_episode_steps = 50
    max_reward = 13
    viewpoint = ((0.6, -0.2, 0.2), (0.0, 0.0, 0.2))
    cameras = (Camera((0.3, 0.0, 0.2), (-0.1, 0.0, 0.0)),)
    sensed = ("is_grasped", "tcp_pose", "bin_pos")

    sphere = Ball(RADIUS, DARK_BLUE, start=(0.0, 0.0, 0.0))
    bin = Compound(bin_shapes(), kind="kinematic")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay down the ball near the robot and the bin beyond it."""
        x = rng.uniform(1, 1) * 0.05 - 0.1
        y = rng.uniform(1, 1) * 0.2 - 0.1
        world.set_pose("sphere", (x.item(), y.item(), RADIUS))
        x = rng.uniform(1, 1) * 0.1
        y = rng.uniform(1, 1) * 0.2 - 0.1
        world.set_pose("bin", (x.item(), y.item(), WALL))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: in the bin, at rest and let go."""
        grasped = state.is_grasping("arm", "sphere")
        placed = lies_on(state, "sphere", "bin", TOLERANCE, RADIUS, WALL)
        static = is_at_rest(state, "sphere")
        return {
            "is_obj_grasped": grasped,
            "is_obj_on_bin": placed,
            "is_obj_static": static,
            "success": placed & static & ~grasped,
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Grasp, TCP, bin and ball."""
        return {
            "is_grasped": info["is_obj_grasped"],
            "tcp_pose": state.tcp_pose("arm"),
            "bin_pos": state.position("bin"),
            "obj_pose": state.pose("sphere"),
            "tcp_to_obj_pos": state.tcp_offset("arm", "sphere"),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach (2), grasp and place (5), let go, come to rest, hold still; 13 on success."""
        grasped = info["is_obj_grasped"]
        reach, place = closeness(
            state.tcp_distance("arm", "sphere"),
            distance_to_top(state, "sphere", "bin", WALL, RADIUS),
        )
        released = letting_go(state, "arm", grasped, 16.0)
        arm_static = self.agent_is_static(state, "arm", STATIC_SPEED)
        placed = 6.0 + (released + stillness(state, "sphere") + arm_static) / 3.0
        reward = where(grasped, 4.0 + place, 2.0 * reach)
        reward = where(info["is_obj_on_bin"], placed, reward)
        return where(info["success"], 13.0, reward)
