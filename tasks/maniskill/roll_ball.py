"""RollBall: hit a ball so that it rolls to a target at the far end of the table."""

from __future__ import annotations

from math import hypot

from layouts import Layout, Placement
from layouts.placement import load_robot
from tasks import (
    FACE_UP,
    TARGET_HEIGHT,
    Ball,
    Camera,
    EpisodeRandom,
    Info,
    PhysicsSettings,
    State,
    Target,
    World,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Floats, norm, tanh, where

# mani_skill 3.0.1, envs/tasks/tabletop/roll_ball.py (m)
BALL_RADIUS = 0.035
GOAL_RADIUS = 0.1
SPAWN_HALF_WIDTH, SPAWN_X = 0.3, -0.1  # of ball and target: x in SPAWN_X ± SPAWN_HALF_WIDTH
SPAWN_DEPTH = 0.2  # of ball and target, along y
BALL_Y = 0.5  # nearest to the target
HIT_OFFSET = BALL_RADIUS + 0.05  # from the ball to where the TCP should hit it, off the target
HIT_RADIUS = 0.04  # around that point
BASE_POSITION = (-0.1, 1.0, 0.0)
# Native writes (0.7071, 0, 0, -0.7072), which PhysX scales to length 1.
BASE_LENGTH = hypot(0.7071, 0.7072)
BASE_QUATERNION = (0.7071 / BASE_LENGTH, 0.0, 0.0, -0.7072 / BASE_LENGTH)


@register_task("RollBall-v1", "maniskill.roll_ball_native")
class RollBall(Clone):
    """Roll a ball along the table onto a round target out of the arm's reach.

    The arm stands at y = 1 and faces -y; the ball lies at y in [0.5, 0.7], the target at y in
    [-0.9, -0.7], both with x in [-0.4, 0.2] (m). Success: the ball is within 10 cm of the target's
    middle, seen from above; it need not stop there.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/roll_ball.py"
    layout = Layout({"arm": Placement(load_robot("panda"), BASE_POSITION, BASE_QUATERNION)})
    physics = PhysicsSettings()
    max_episode_steps = 80
    max_reward = 30
    viewpoint = ((-0.6, 1.3, 0.8), (0.0, 0.13, 0.0))
    cameras = (Camera((-0.1, 0.9, 0.3), (0.0, 0.0, 0.0)),)

    ball = Ball(BALL_RADIUS, (0.0, 0.2, 0.8, 1.0), start=(0.0, 0.0, 0.1))
    goal_region = Target(GOAL_RADIUS)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the ball before the arm and the target at the far end."""
        x = (rng.uniform(1) * 2 - 1) * SPAWN_HALF_WIDTH + SPAWN_X
        y = rng.uniform(1) * SPAWN_DEPTH + BALL_Y
        world.set_pose("ball", (x.item(), y.item(), BALL_RADIUS))
        x = (rng.uniform(1) * 2 - 1) * SPAWN_HALF_WIDTH + SPAWN_X
        y = rng.uniform(1) * SPAWN_DEPTH - 1.0 + GOAL_RADIUS
        world.set_pose("goal_region", (x.item(), y.item(), TARGET_HEIGHT), FACE_UP)

    def remember(self, state: State) -> dict[str, Array]:
        """Whether the arm has been where it should hit from."""
        return {"reached": state.full(False)}

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: over the target."""
        return {"success": state.planar_distance("ball", "goal_region") < GOAL_RADIUS}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP, target, ball, how it rolls, and the ways between them."""
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "goal_pos": state.position("goal_region"),
            "ball_pose": state.pose("ball"),
            "ball_vel": state.linear_velocity("ball"),
            "tcp_to_ball_pos": state.tcp_offset("arm", "ball"),
            "ball_to_goal_pos": state.offset("ball", "goal_region"),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach behind the ball (1); from then on roll (1 … 21); 30 on success.

        Whether the arm was behind the ball is remembered until the next reset, and noticed only
        by this reward, as in native.
        """
        off_target = state.offset("goal_region", "ball")
        off_target = off_target / state.distance("goal_region", "ball")[:, None]
        hit_from = state.position("ball") + off_target * HIT_OFFSET
        hit_distance = norm(hit_from - state.tcp_position("arm"))
        self.memory.reached |= hit_distance < HIT_RADIUS
        rolled = 1.0 - tanh(state.planar_distance("ball", "goal_region"))
        reach = 1.0 - tanh(2.0 * hit_distance)
        reward = where(self.memory.reached, 20.0 * rolled + 1.0, reach)
        return where(info["success"], 30.0, reward)
