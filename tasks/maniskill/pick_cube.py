"""PickCube: grasp a cube and hold it at a goal."""

from __future__ import annotations

from typing import ClassVar

from layouts import single
from tasks import (
    Cube,
    EpisodeRandom,
    Goal,
    Info,
    PhysicsSettings,
    State,
    World,
    closeness,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Floats, norm, where

# mani_skill 3.0.1, envs/tasks/tabletop/pick_cube.py
STATIC_SPEED = 0.2  # rad/s


@register_task("PickCube-v1", "maniskill.pick_cube_native")
class PickCube(Clone):
    """Grasp a cube from the table and hold it still at a goal in the air.

    Cube and goal are drawn from a square of 0.2 m around the origin, the goal up to 0.3 m above
    the cube. Success: the cube is within 2.5 cm of the goal and the arm is static.

    Attributes:
        cube: What to grasp.
        goal_site: Where to hold it; its radius is how near the cube must come.
        spawn_half_size: Half the edge of the square that cube and goal are drawn from (m).
        spawn_centre: Its centre, x and y (m).
        max_goal_height: How high above the cube the goal may be (m).
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/pick_cube.py"
    layout = single({"arm": "panda"})
    physics = PhysicsSettings()
    max_episode_steps = 50
    max_reward = 5
    sensed = ("is_grasped", "tcp_pose", "goal_pos")

    # mani_skill 3.0.1, envs/tasks/tabletop/pick_cube_cfgs.py, "panda"
    cube: ClassVar[Cube] = Cube(0.02)
    goal_site: ClassVar[Goal] = Goal(0.025)
    spawn_half_size: ClassVar[float] = 0.1
    spawn_centre: ClassVar[tuple[float, float]] = (0.0, 0.0)
    max_goal_height: ClassVar[float] = 0.3

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the cube on the table and the goal above it."""
        x, y = self._place(rng)
        world.set_pose("cube", (x, y, self.cube.half_size), rng.yaw_quaternion())
        x, y = self._place(rng)
        z = rng.uniform(1) * self.max_goal_height + self.cube.half_size
        world.set_pose("goal_site", (x, y, z.item()))

    def _place(self, rng: EpisodeRandom) -> list[float]:
        offset = rng.uniform(1, 2) * (self.spawn_half_size * 2) - self.spawn_half_size
        return (offset[0] + offset.new_tensor(self.spawn_centre)).tolist()

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: placed and static."""
        placed = state.distance("cube", "goal_site") <= self.goal_site.radius
        static = self.agent_is_static(state, "arm", STATIC_SPEED)
        return {
            "success": placed & static,
            "is_obj_placed": placed,
            "is_robot_static": static,
            "is_grasped": state.is_grasping("arm", "cube"),
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Grasp, TCP, goal and cube."""
        tcp = self.agent_tcp_pose(state, "arm")
        return {
            "is_grasped": info["is_grasped"],
            "tcp_pose": tcp,
            "goal_pos": state.position("goal_site"),
            "obj_pose": state.pose("cube"),
            "tcp_to_obj_pos": state.position("cube") - tcp[:, :3],
            "obj_to_goal_pos": state.offset("cube", "goal_site"),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach (1), grasp (1), place (1), hold still (1); 5 on success."""
        reach, place, still = closeness(
            norm(state.position("cube") - self.agent_tcp_pose(state, "arm")[:, :3]),
            state.distance("cube", "goal_site"),
            self.agent_speed(state, "arm", fingers=True),
        )
        grasped, placed = info["is_grasped"], info["is_obj_placed"]
        reward = reach + grasped + place * grasped + still * placed
        return where(info["success"], 5.0, reward)
