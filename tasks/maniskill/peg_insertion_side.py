"""PegInsertionSide: grasp a peg and push it sideways into a box with a hole, new at each reset."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

from layouts import single
from tasks import (
    Box,
    Camera,
    EpisodeRandom,
    Finish,
    Info,
    PhysicsSettings,
    State,
    World,
    add_table,
    compose,
    inverse,
    linear,
    once_per_state,
    register_task,
    transform,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Floats, concatenate, maximum, norm, tanh, where

# mani_skill 3.0.1, envs/tasks/tabletop/peg_insertion_side.py (m, rad)
HALF_LENGTH = (0.085, 0.125)  # of the peg, and of the box along the hole: smallest, largest
RADIUS = (0.015, 0.025)  # half the peg's thickness
CLEARANCE = 0.003  # between peg and hole
PEG_SPAWN = ((-0.1, -0.3), (0.1, 0.0))  # lowest, highest x and y
PEG_YAW = (pi / 2 - pi / 3, pi / 2 + pi / 3)
BOX_SPAWN = ((-0.05, 0.2), (0.05, 0.4))
BOX_YAW = (pi / 2 - pi / 8, pi / 2 + pi / 8)
INSERTED = -0.015  # x of the peg's head in the hole's frame
ALIGNED = 0.01  # peg from the hole's axis
GRASP_X = -0.06  # where to grasp, behind the peg's middle
MAX_GRASP_ANGLE = 20.0  # degrees; stricter than the robot's own

ORANGE, CREAM, WOOD = linear("#EC7357"), linear("#EDF6F9"), linear("#FFD289")
SATIN = Finish(roughness=0.5, specular=0.5)


@dataclass(frozen=True)
class PegDesign:
    """Geometry of one episode.

    Attributes:
        half_length: Half the peg's length, the box's depth and its outer half width (m).
        radius: Half the peg's thickness (m).
        hole_centre: y and z of the hole's axis in the box's frame (m).
    """

    half_length: float
    radius: float
    hole_centre: tuple[float, float]

    @property
    def hole_radius(self) -> float:
        """Half the hole's width (m)."""
        return self.radius + CLEARANCE

    def peg(self) -> list[Box]:
        """Return the peg along x: one solid box, drawn as an orange head and a light tail."""
        half, radius = self.half_length, self.radius
        solid = Box(half_size=(half, radius, radius), visible=False)
        ends = [
            Box(
                half_size=(half / 2, radius, radius),
                position=(x, 0.0, 0.0),
                color=color,
                finish=SATIN,
                collides=False,
            )
            for x, color in ((half / 2, ORANGE), (-half / 2, CREAM))
        ]
        return [solid, *ends]

    def box_with_hole(self) -> list[Box]:
        """Return the four walls around the hole, which runs along x."""
        depth = width = self.half_length
        wall = (width - self.hole_radius) * 0.5
        y, z = (centre * 0.5 for centre in self.hole_centre)
        offset = wall + self.hole_radius
        walls = (
            ((depth, wall - y, width), (0.0, offset + y, 0.0)),
            ((depth, wall + y, width), (0.0, -offset + y, 0.0)),
            ((depth, width, wall - z), (0.0, 0.0, offset + z)),
            ((depth, width, wall + z), (0.0, 0.0, -offset + z)),
        )
        return [
            Box(half_size=size, position=position, color=WOOD, finish=SATIN)
            for size, position in walls
        ]


@register_task("PegInsertionSide-v1", "maniskill.peg_insertion_side_native")
class PegInsertionSide(Clone):
    """Grasp a peg and push its orange head into the hole of a box, which lies across the table.

    Every reset draws the peg's length and thickness and the hole's place, and builds both anew.
    Success: the head is inside the hole, at most 1.5 cm short of the box's middle.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/peg_insertion_side.py"
    layout = single({"arm": "panda_wristcam"})
    physics = PhysicsSettings()
    max_episode_steps = 100
    max_reward = 10
    rebuilds = True
    joint_noise_draws = 2
    viewpoint = ((0.5, -0.5, 0.8), (0.05, -0.1, 0.4))

    def design(self, rng: EpisodeRandom) -> PegDesign:
        """Draw peg and hole from the numpy stream."""
        half_length, radius = rng.numpy.uniform(*HALF_LENGTH), rng.numpy.uniform(*RADIUS)
        y, z = 0.5 * (half_length - radius) * rng.numpy.uniform(-1, 1, size=2)
        return PegDesign(half_length, radius, (y, z))

    cameras = (Camera((0.0, -0.3, 0.2), (0.0, 0.0, 0.1)),)

    def build(self, world: World) -> None:
        """Add the table, the peg and the box."""
        add_table(world)
        world.add("peg", *world.design.peg(), position=(0.0, 0.0, 0.1))
        walls = world.design.box_with_hole()
        world.add("box_with_hole", *walls, kind="kinematic", position=(0.0, 1.0, 0.1))

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay peg and box on the table."""
        x, y = rng.uniform_between(*PEG_SPAWN).tolist()
        world.set_pose("peg", (x, y, world.design.radius), rng.yaw_quaternion(*PEG_YAW))
        x, y = rng.uniform_between(*BOX_SPAWN).tolist()
        height = world.design.half_length
        world.set_pose("box_with_hole", (x, y, height), rng.yaw_quaternion(*BOX_YAW))

    def remember(self, state: State) -> dict[str, Array]:
        """The designs of peg and hole."""
        designs: list[PegDesign] = [world.design for world in self.simulation.worlds]
        return {
            "half_sizes": state.array([(d.half_length, d.radius, d.radius) for d in designs]),
            "head": state.array([(d.half_length, 0.0, 0.0) for d in designs]),  # of the peg
            "hole": state.array([(0.0, *d.hole_centre, 1.0, 0.0, 0.0, 0.0) for d in designs]),
            "hole_radii": state.array([d.hole_radius for d in designs]),
        }

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: the peg's head is in the hole, deep enough."""
        at_hole = transform(inverse(self._hole_pose(state)), self._head_position(state))
        x, y, z = at_hole.T
        inside = maximum(abs(y), abs(z)) <= self.memory.hole_radii
        return {"success": (x >= INSERTED) & inside, "peg_head_pos_at_hole": at_hole}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP, peg and hole, each with its size."""
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "peg_pose": state.pose("peg"),
            "peg_half_size": self.memory.half_sizes,
            "box_hole_pose": self._hole_pose(state),
            "box_hole_radius": self.memory.hole_radii,
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach the peg's tail (1), grasp (1), line up (3), insert (5); 10 on success."""
        peg, hole = state.pose("peg"), self._hole_pose(state)
        to_grasp = state.tcp_position("arm") - transform(peg, state.array(((GRASP_X, 0.0, 0.0),)))
        reach = 1.0 - tanh(4.0 * norm(to_grasp))
        grasped = state.is_grasping("arm", "peg", MAX_GRASP_ANGLE)

        # Where the peg's middle is when its head is at the hole's centre
        goal = concatenate((transform(hole, -self.memory.head), hole[:, 3:]), 1)
        to_goal = inverse(goal)
        head_off, middle_off = (
            norm(transform(to_goal, point)[:, 1:])
            for point in (self._head_position(state), peg[:, :3])
        )
        astray = 0.5 * (head_off + middle_off) + 4.5 * maximum(head_off, middle_off)
        line_up = 3.0 * (1.0 - tanh(astray))
        aligned = (head_off < ALIGNED) & (middle_off < ALIGNED)
        depth = norm(info["peg_head_pos_at_hole"])
        insert = 5.0 * (1.0 - tanh(5.0 * depth))
        reward = reach + grasped + line_up * grasped + insert * (grasped & aligned)
        return where(info["success"], 10.0, reward)

    @once_per_state
    def _hole_pose(self, state: State) -> Floats:
        """Pose of the hole's centre, x along its axis, (N, 7)."""
        return compose(state.pose("box_with_hole"), self.memory.hole)

    @once_per_state
    def _head_position(self, state: State) -> Floats:
        """Position of the middle of the peg's head, (N, 3) (m)."""
        return transform(state.pose("peg"), self.memory.head)
