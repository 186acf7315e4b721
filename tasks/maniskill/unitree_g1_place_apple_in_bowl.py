"""UnitreeG1PlaceAppleInBowl: a humanoid takes an apple from a kitchen counter and drops it."""

from __future__ import annotations

from math import cos, pi, sin

from layouts import Layout, Placement
from objects.shapes import MeshCollision
from robots import Fingers
from robots.assets.locator import APPLE, APPLE_BODY, BOWL, BOWL_BODY, FileLocator
from tasks import (
    Camera,
    Compound,
    EpisodeRandom,
    Info,
    KitchenCounter,
    Mesh,
    Needs,
    PhysicsSettings,
    State,
    World,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Floats, abs, floats, mean, norm, tanh, where

# mani_skill 3.0.1, envs/tasks/humanoid/humanoid_pick_place.py (m)
ROBOT = "unitree_g1_simplified_upper_body_with_head_camera"
SCALE = 0.82  # of counter and bowl
APPLE_SCALE = SCALE * 0.8
SPAWN = ((-0.025, -0.025), (0.025, 0.025))  # of apple and bowl: lowest, highest x and y
APPLE_HEIGHT, BOWL_HEIGHT = 0.7335, 0.753
BOWL_Y = -0.4
APPLE_START, BOWL_START = (0.0, BOWL_Y, 0.78), (0.0, BOWL_Y, BOWL_HEIGHT)
PLACED = 0.05  # between the apple's origin and the bowl's
HAND_ABOVE = 0.125  # of the hand over the bowl
DROP_HEIGHT, DROP_RADIUS = 0.15, 0.025  # over the bowl, where the hand should open
UPRIGHT = (cos(pi / 4), sin(pi / 4), 0.0, 0.0)  # the files' y axis points up

# agents/robots/unitree_g1/g1_upper_body.py: the thumb and either finger, at most 110° off
HAND = "right_tcp_link"
GRASPS = tuple(
    Fingers(("right_two_link", finger), min_force=0.5, max_angle=110.0)
    for finger in ("right_four_link", "right_six_link")
)
FINGER_JOINTS = tuple(
    f"right_{number}_joint" for number in ("one", "two", "three", "four", "five", "six")
)


def _mesh(
    body: FileLocator, looks: FileLocator, scale: float, collision: MeshCollision
) -> tuple[Mesh, Mesh]:
    """Return what collides, and what is seen."""
    sizes = (scale, scale, scale)
    solid = Mesh(body, sizes, collision, quaternion=UPRIGHT, visible=False)
    return solid, Mesh(looks, sizes, quaternion=UPRIGHT, textured=True, collides=False)


@register_task("UnitreeG1PlaceAppleInBowl-v1", "maniskill.unitree_g1_place_apple_in_bowl_native")
class UnitreeG1PlaceAppleInBowl(Clone):
    """Take an apple from a kitchen counter with the right hand and drop it into a bowl beside it.

    A humanoid that cannot walk stands before the counter. The apple lies before it, the bowl stands
    0.4 m to its right, each up to 2.5 cm off in x and y; the apple is turned by any angle. Success:
    the apple is within 5 cm of the bowl's middle, and the right hand 12.5 cm or more above it.
    """

    source = "mani_skill 3.0.1, envs/tasks/humanoid/humanoid_pick_place.py"
    layout = Layout(
        {"robot": Placement(ROBOT, (-0.3, 0.0, 0.755), keyframe="standing", qpos_noise=0.0)}
    )
    needs = {"robot": Needs(joints=FINGER_JOINTS)}
    physics = PhysicsSettings(contact_offset=0.01)
    table = KitchenCounter(SCALE)
    max_episode_steps = 100
    max_reward = 10
    viewpoint = ((0.279123, 0.303438, 1.34794), (-0.222864, -0.012452, 0.671018))
    cameras = (
        Camera((0.279123, 0.303438, 1.34794), quaternion=(0.252428, 0.396735, 0.114442, -0.875091)),
    )
    sensed = ("is_grasped", "tcp_pose")

    bowl = Compound(_mesh(BOWL_BODY, BOWL, SCALE, "surface"), kind="kinematic", start=BOWL_START)
    apple = Compound(_mesh(APPLE_BODY, APPLE, APPLE_SCALE, "pieces"), start=APPLE_START)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the apple on the counter, and stand the bowl to its right."""
        x, y = rng.uniform_between(*SPAWN)
        world.set_pose("apple", (x.item(), y.item(), APPLE_HEIGHT), rng.yaw_quaternion())
        x, y = rng.uniform_between(*SPAWN)
        world.set_pose("bowl", (x.item(), (y + BOWL_Y).item(), BOWL_HEIGHT))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: in the bowl, the hand out of it."""
        above = self._hand(state)[:, 2] > state.position("bowl")[:, 2] + HAND_ABOVE
        first, second = (state.is_held("robot", "apple", grasp) for grasp in GRASPS)
        return {
            "success": (state.distance("apple", "bowl") <= PLACED) & above,
            "hand_outside_bowl": above,
            "is_grasped": first | second,
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Whether the apple is held, the hand, bowl and apple, and the ways between them."""
        return {
            "is_grasped": info["is_grasped"],
            "tcp_pose": state.link_pose("robot", HAND),
            "bowl_pos": state.position("bowl"),
            "obj_pose": state.pose("apple"),
            "tcp_to_obj_pos": state.position("apple") - self._hand(state),
            "obj_to_goal_pos": state.offset("apple", "bowl"),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Reach (1), grasp (2), carry over the bowl (3), open the hand there (6); 10 on success."""
        apple, held = state.position("apple"), floats(info["is_grasped"])
        drop = state.position("bowl") + state.array(((0.0, 0.0, DROP_HEIGHT),))
        to_drop = norm(drop - apple)
        place = 1.0 - tanh(to_drop * 5.0)
        open_hand = 1.0 - tanh(mean(abs(self._fingers(state)), 1))
        reach = 1.0 - tanh(norm(apple - self._hand(state)) * 5.0)
        reward = reach + held + place * held
        reward = where(to_drop < DROP_RADIUS, 4.0 + place + open_hand, reward)
        return where(info["success"], 8.0 + (place + open_hand), reward)

    def _hand(self, state: State) -> Floats:
        """Position of the right hand's TCP, (N, 3) (m)."""
        return state.link_position("robot", HAND)

    def _fingers(self, state: State) -> Floats:
        """Positions of the right hand's joints but for the thumb's turn, (N, 6) (rad)."""
        joints = self.layout["robot"].robot.joints
        return state.qpos("robot")[:, [joints.index(joint) for joint in FINGER_JOINTS]]
