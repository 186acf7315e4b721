"""UnitreeG1TransportBox: a humanoid turns with a box from one table to the one behind it."""

from __future__ import annotations

from math import cos, pi, sin

from layouts import Layout, Placement
from robots.assets.locator import CARDBOARD_BOX, TABLE, FileLocator
from tasks import (
    Box,
    Camera,
    Compound,
    EpisodeRandom,
    Ground,
    Info,
    Mesh,
    Needs,
    PhysicsSettings,
    State,
    World,
    register_task,
    transform,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Flags, Floats, abs, norm, sum, tanh, where

# mani_skill 3.0.1, envs/tasks/humanoid/transport_box.py (m, rad)
ROBOT = "unitree_g1_simplified_upper_body_with_head_camera"
TORSO = "torso_joint"
LEFT_ROLL, RIGHT_ROLL = "left_shoulder_roll_joint", "right_shoulder_roll_joint"
RAISED = 1.25  # of the shoulders' rolls, outward, when an episode begins
TABLE_HALF_SIZE = (1.658057143 / 2, 0.829028571 / 2, 0.630612274 / 2)
TABLE_Y = 0.66  # of the goal's table; the box stands on the other one, at -TABLE_Y
TABLE_SCALE, BOX_SCALE = 1.2, 0.12  # of the files
BOX_HALF_SIZE = (0.18, 0.12, 0.12)
BOX_DENSITY = 200.0  # kg/m³
BOX_START = (-0.1, -0.37, 0.7508)
BOX_SPAWN = ((-0.05, -0.05), (0.2, 0.05))  # lowest, highest x and y from BOX_START
BOX_YAW = (0.0, pi / 6)
GRASP_POINTS = {"left": ((0.165, 0.07, 0.05),), "right": ((-0.165, 0.07, 0.05),)}  # of the box
ABOVE_POINT = 0.04  # that a hand may be, and grasp
PALM = ("five_link", "three_link", "palm_link")  # of a hand, which press on the box
HELD = 10.0  # N; sum of the three components of what both hands have to press with
GOAL_X, GOAL_Y, GOAL_Z = (-0.78, 0.78), (0.3, 1.0), (0.750, 0.751)
FACING = (-1.7, -1.4)  # of the torso, turned to the box
QUARTER_TURN = (cos(pi / 4), 0.0, 0.0, sin(pi / 4))


def _seen(file: FileLocator, scale: float) -> Mesh:
    """Return what a body looks like."""
    sizes = (scale, scale, scale)
    return Mesh(file, sizes, quaternion=QUARTER_TURN, textured=True, collides=False)


@register_task("UnitreeG1TransportBox-v1", "maniskill.unitree_g1_transport_box_native")
class UnitreeG1TransportBox(Clone):
    """Take a box from the table on the right in both hands, turn, and put it on the left one.

    A humanoid that cannot walk stands between two tables, its arms spread. The box stands on the
    right table, at x in [-0.15, 0.1] and y in [-0.42, -0.32] (m), turned by up to 30°. Success: it
    stands on the left table, and not both hands hold it.
    """

    source = "mani_skill 3.0.1, envs/tasks/humanoid/transport_box.py"
    layout = Layout(
        {
            "robot": Placement(
                ROBOT,
                (-0.1, 0.0, 0.755),
                qpos=(0.0, 0.0, 0.0, RAISED, -RAISED, *(0.0,) * 20),
                qpos_noise=0.0,
            )
        }
    )
    needs = {"robot": Needs(joints=(TORSO, LEFT_ROLL, RIGHT_ROLL))}
    physics = PhysicsSettings()
    table = Ground(mipmaps=7)
    max_episode_steps = 100
    max_reward = 5
    viewpoint = ((1.0, 0.0, 1.6), (0.0, 0.0, 0.65))
    cameras = (Camera((1.0, 0.0, 1.6), (0.0, 0.0, 0.65), fov=pi / 3),)

    box = Compound(
        (
            Box(half_size=BOX_HALF_SIZE, density=BOX_DENSITY, visible=False),
            _seen(CARDBOARD_BOX, BOX_SCALE),
        ),
        start=BOX_START,
    )

    def build(self, world: World) -> None:
        """Add the ground, both tables, under native's names, and the box."""
        self.table.add_to(world, "table")
        top = Box(half_size=TABLE_HALF_SIZE, position=(0.0, 0.0, TABLE_HALF_SIZE[2]), visible=False)
        for name, y in (("table-1", TABLE_Y), ("table-2", -TABLE_Y)):
            seen = _seen(TABLE, TABLE_SCALE)
            world.add(name, top, seen, kind="static", position=(0.0, y, 0.0))
        self.box.add_to(world, "box")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the box on the right table."""
        x, y = rng.uniform_between(*BOX_SPAWN)
        place = ((x + BOX_START[0]).item(), (y + BOX_START[1]).item(), BOX_START[2])
        world.set_pose("box", place, rng.yaw_quaternion(*BOX_YAW))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: on the left table, and not in both hands."""
        x, y, z = state.position("box").T
        over_goal = _between(x, GOAL_X) & _between(y, GOAL_Y)
        left, right = (self._pressure(state, side) for side in GRASP_POINTS)
        held = (left > HELD) & (right > HELD)
        for side in GRASP_POINTS:
            point = self._grasp_point(state, side)[:, 2]
            held = held & (self._hand(state, side)[:, 2] < point + ABOVE_POINT)
        return {
            "success": ~held & over_goal & _between(z, GOAL_Z),
            "left_hand_hit_box": left > 0.0,
            "right_hand_hit_box": right > 0.0,
            "box_grasped": held,
            "box_at_correct_table_xy": over_goal,
            "facing_table_with_box": _between(self._joint(state, TORSO), FACING),
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Both hands, the box, and the ways between them."""
        box = state.position("box")
        return {
            "right_tcp_pose": state.link_pose("robot", "right_tcp_link"),
            "left_tcp_pose": state.link_pose("robot", "left_tcp_link"),
            "box_pose": state.pose("box"),
            "right_tcp_to_box_pos": box - self._hand(state, "right"),
            "left_tcp_to_box_pos": box - self._hand(state, "left"),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Turn to the box (1), grasp it (2), turn back (3), let go (4); 5 on success."""
        torso, left, right = (self._joint(state, j) for j in (TORSO, LEFT_ROLL, RIGHT_ROLL))
        turn = 1.0 - tanh(abs(torso + 1.4))
        grasp = 1.0 + _share(left, 4.0) + _share(right, 4.0)
        for side in ("right", "left"):
            way = norm(self._hand(state, side) - self._grasp_point(state, side))
            grasp = grasp + _share(way * 3.0, 4.0)
        turn_back = 3.0 - tanh(abs(torso - 1.4) / 5.0)
        let_go = 3.0 + _share(left - RAISED, 2.0) + _share(right + RAISED, 2.0)
        reward = where(info["facing_table_with_box"], grasp, turn)
        reward = where(info["box_grasped"], turn_back, reward)
        reward = where(info["box_at_correct_table_xy"], let_go, reward)
        return where(info["success"], 5.0, reward)

    def _joint(self, state: State, joint: str) -> Floats:
        """Position of a joint of the robot, (N,) (rad)."""
        return state.qpos("robot")[:, self.layout["robot"].robot.joints.index(joint)]

    def _hand(self, state: State, side: str) -> Floats:
        """Position of a hand's TCP, (N, 3) (m)."""
        return state.link_position("robot", f"{side}_tcp_link")

    def _grasp_point(self, state: State, side: str) -> Floats:
        """Where a hand should hold the box, (N, 3) (m, world)."""
        return transform(state.pose("box"), state.array(GRASP_POINTS[side]))

    def _pressure(self, state: State, side: str) -> Floats:
        """Sum of the components' sizes of a hand's force on the box, (N,) (N)."""
        one, two, three = (state.contact_force("robot", f"{side}_{link}", "box") for link in PALM)
        return sum(abs(one + two + three), 1)


def _between(values: Floats, bounds: tuple[float, float]) -> Flags:
    low, high = bounds
    return (values < high) & (values > low)


def _share(distance: Floats, whole: float) -> Floats:
    """Return what is to become nothing, (N,), as a reward of ``1 / whole`` at most."""
    return (1.0 - tanh(abs(distance))) / whole
