"""PokeCube: grasp a peg and push a cube onto a target with it."""

from __future__ import annotations

from math import pi

from layouts import single
from tasks import (
    DARK_BLUE,
    FACE_UP,
    TARGET_HEIGHT,
    Cube,
    EpisodeRandom,
    Info,
    Peg,
    PhysicsSettings,
    State,
    Target,
    World,
    closeness,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Floats, norm, where

# mani_skill 3.0.1, envs/tasks/tabletop/poke_cube.py (m, rad)
CUBE_HALF_SIZE = 0.02
PEG_HALF_WIDTH = 0.025
PEG_HALF_LENGTH = 0.12
GOAL_RADIUS = 0.05
GOAL_OFFSET = 0.05 + GOAL_RADIUS  # of the target from the cube, along x
SPAWN_HALF_SIZE = 0.1
CUBE_GAP = 0.1  # from the peg's head to the cube's centre, along x
MAX_CUBE_YAW = pi / 6
STATIC_SPEED = 0.2  # rad/s
GRASP_RADIUS = 0.01  # between the TCP and the peg's middle
MAX_ANGLE = 0.05  # between peg and cube while they fit
MAX_HEAD_DISTANCE = CUBE_HALF_SIZE + 0.005  # between the peg's head and the cube's centre


@register_task("PokeCube-v1", "maniskill.poke_cube_native")
class PokeCube(Clone):
    """Grasp a square peg, 24 cm long, and poke a cube onto a round target with it.

    The peg lies along x, its middle drawn from a square of 0.2 m around the origin; the cube lies
    10 cm beyond its head at y in [-0.1, 0.1], turned by up to 30°, and the target 10 cm behind the
    cube. Success: the cube is within 5 cm of the target's middle, seen from above, and the arm is
    static.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/poke_cube.py"
    layout = single({"arm": "panda"})
    physics = PhysicsSettings()
    max_episode_steps = 50
    max_reward = 10
    viewpoint = ((0.6, 0.7, 0.6), (0.2, 0.2, 0.35))

    cube = Cube(CUBE_HALF_SIZE, start=(1.0, 0.0, CUBE_HALF_SIZE))
    peg = Peg(PEG_HALF_LENGTH, PEG_HALF_WIDTH, DARK_BLUE, DARK_BLUE)
    goal_region = Target(GOAL_RADIUS)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay down the peg, the cube beyond its head and the target behind the cube."""
        peg = (rng.uniform(1, 3) * (SPAWN_HALF_SIZE * 2) - SPAWN_HALF_SIZE)[0]
        world.set_pose("peg", (peg[0].item(), peg[1].item(), PEG_HALF_WIDTH))
        y = (rng.uniform(1, 3) * (SPAWN_HALF_SIZE * 2) - SPAWN_HALF_SIZE)[0, 1].item()
        x = peg[0] + PEG_HALF_LENGTH + CUBE_GAP
        turn = rng.yaw_quaternion(-MAX_CUBE_YAW, MAX_CUBE_YAW)
        world.set_pose("cube", (x.item(), y, CUBE_HALF_SIZE), turn)
        world.set_pose("goal_region", ((x + GOAL_OFFSET).item(), y, TARGET_HEIGHT), FACE_UP)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: the cube is over the target, and the arm static."""
        placed = state.planar_distance("cube", "goal_region") < GOAL_RADIUS
        angle = abs(state.last_euler_angle("peg") - state.last_euler_angle("cube"))
        head_distance = norm(_cube_to_head(state)[:, :2])
        return {
            "success": placed & self.agent_is_static(state, "arm", STATIC_SPEED),
            "is_cube_placed": placed,
            "is_peg_cube_fit": (angle < MAX_ANGLE) & (head_distance <= MAX_HEAD_DISTANCE),
            "is_peg_grasped": state.is_grasping("arm", "peg"),
            "angle_diff": angle,
            "head_to_cube_dist": head_distance,
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP, cube, peg, and the ways between them; native's ``goal_pos`` is the peg's."""
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "cube_pose": state.pose("cube"),
            "peg_pose": state.pose("peg"),
            "goal_pos": state.position("peg"),
            "tcp_to_peg_pos": state.tcp_offset("arm", "peg"),
            "peg_to_cube_pos": state.offset("peg", "cube"),
            "cube_to_goal_pos": state.offset("cube", "goal_region"),
            "peghead_to_cube_pos": _cube_to_head(state),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach (2), bring the grasped peg to the cube (6), push (8), stop (1); 10 on success."""
        tcp_to_peg = state.tcp_distance("arm", "peg")
        reach, align, near, place, still = closeness(
            tcp_to_peg,
            info["angle_diff"],
            info["head_to_cube_dist"],
            state.distance("cube", "goal_region"),
            self.agent_speed(state, "arm", fingers=False),
        )
        held = info["is_peg_grasped"] & (tcp_to_peg < GRASP_RADIUS)
        reward = where(held, 4.0 + near + align, 2.0 * reach)
        reward = where(held & info["is_peg_cube_fit"], 7.0 + place, reward)
        reward = where(info["is_cube_placed"], reward + still, reward)
        return where(info["success"], 10.0, reward)


def _cube_to_head(state: State) -> Floats:
    """Way from the cube to the peg's head, (N, 3) (m).

    As in native, the head is half a peg along the world's x axis from the peg's middle, however
    the peg is turned.
    """
    return state.position("peg") + state.array((PEG_HALF_LENGTH, 0.0, 0.0)) - state.position("cube")
