"""PlugCharger: pick a charger up and plug it into a receptacle."""

from __future__ import annotations

from math import pi

from layouts import single
from tasks import (
    POLISHED,
    WHITE,
    Box,
    Compound,
    EpisodeRandom,
    Finish,
    Info,
    PhysicsSettings,
    State,
    Vector3,
    World,
    angle_between,
    compose,
    linear,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, norm

# mani_skill 3.0.1, envs/tasks/tabletop/plug_charger.py (m, rad)
BODY_HALF_SIZE = (2e-2, 1.5e-2, 1.2e-2)
PRONG_HALF_SIZE = (8e-3, 0.75e-3, 3.2e-3)
PRONG_OFFSET = 7e-3  # of each prong from the middle
CLEARANCE = 5e-4  # on each side of a prong
RECEPTACLE_HALF_SIZE = (1e-2, 5e-2, 5e-2)
RECEPTACLE_HEIGHT = 0.1
CHARGER_SPAWN = ((-0.1, -0.2), (-0.01 - PRONG_HALF_SIZE[0] * 2, 0.2))  # lowest, highest x and y
CHARGER_YAW = (-pi / 3, pi / 3)
RECEPTACLE_SPAWN = ((0.01, -0.1), (0.1, 0.1))
RECEPTACLE_YAW = (pi - pi / 8, pi + pi / 8)
PLUGGED_DISTANCE = 5e-3
PLUGGED_ANGLE = 0.2

BRASS = linear("#DBB539")
GLOSSY = Finish(roughness=0.1)


def charger_shapes() -> tuple[Box, ...]:
    """Return the two prongs and the body; the origin is where the prongs leave the body."""
    prongs = [
        Box(
            half_size=PRONG_HALF_SIZE,
            position=(PRONG_HALF_SIZE[0], y, 0.0),
            color=WHITE,
            finish=POLISHED,
        )
        for y in (PRONG_OFFSET, -PRONG_OFFSET)
    ]
    body = Box(
        half_size=BODY_HALF_SIZE,
        position=(-BODY_HALF_SIZE[0], 0.0, 0.0),
        color=WHITE,
        finish=GLOSSY,
    )
    return (*prongs, body)


def receptacle_shapes() -> tuple[Box, ...]:
    """Return the plate around two slots, as five boxes, and the brass that shows in the slots."""
    depth, width, height = RECEPTACLE_HALF_SIZE
    slot_width, slot_height = (size + CLEARANCE for size in PRONG_HALF_SIZE[1:])
    side = 0.5 * (width - slot_width - PRONG_OFFSET)
    lid = 0.5 * (height - slot_height)
    side_y, lid_z = slot_width + PRONG_OFFSET + side, slot_height + lid
    slot_y = PRONG_OFFSET * 0.5 + slot_width

    def box(y: float, z: float, half_size: Vector3, *, brass: bool = False) -> Box:
        return Box(
            half_size=half_size,
            position=(-depth, y, z),
            color=BRASS if brass else WHITE,
            finish=POLISHED if brass else GLOSSY,
            collides=not brass,
        )

    return (
        box(0.0, lid_z, (depth, width, lid)),
        box(0.0, -lid_z, (depth, width, lid)),
        box(side_y, 0.0, (depth, side, height)),
        box(-side_y, 0.0, (depth, side, height)),
        box(0.0, 0.0, (depth, PRONG_OFFSET - slot_width, slot_height)),
        box(-slot_y, 0.0, (depth, slot_width, slot_height), brass=True),
        box(slot_y, 0.0, (depth, slot_width, slot_height), brass=True),
    )


@register_task("PlugCharger-v1", "maniskill.plug_charger_native")
class PlugCharger(Clone):
    """Pick a charger up from the table and plug its two prongs into a receptacle in the air.

    The charger lies before the receptacle, turned by up to 60°; the receptacle hangs 0.1 m above
    the table and faces the robot within 22.5°. Success: the charger is within 5 mm and 0.2 rad of
    being plugged in.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/plug_charger.py"
    layout = single({"arm": "panda_wristcam"}, keyframe="rest")
    physics = PhysicsSettings()
    max_episode_steps = 200
    reward_modes = ("none", "sparse")
    viewpoint = ((0.3, 0.4, 0.35), (-0.05, 0.0, 0.08))

    charger = Compound(charger_shapes(), start=(0.0, 0.0, BODY_HALF_SIZE[2]))
    receptacle = Compound(
        receptacle_shapes(), start=(0.0, 0.0, RECEPTACLE_HEIGHT), kind="kinematic"
    )

    def reset_robots(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the arm with noise from the torch stream.

        Native draws from the numpy stream first, as everywhere, and drops that.
        """
        super().reset_robots(world, rng)
        for name, placement in world.layout.items():
            noise = rng.torch_normal(placement.qpos_noise, placement.robot.dof)
            self.stand(world, name, noise.numpy())

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the charger on the table and hang the receptacle up."""
        x, y = rng.uniform_between(*CHARGER_SPAWN).tolist()
        world.set_pose("charger", (x, y, BODY_HALF_SIZE[2]), rng.yaw_quaternion(*CHARGER_YAW))
        x, y = rng.uniform_between(*RECEPTACLE_SPAWN).tolist()
        turn = rng.yaw_quaternion(*RECEPTACLE_YAW)
        world.set_pose("receptacle", (x, y, RECEPTACLE_HEIGHT), turn)

    def remember(self, state: State) -> dict[str, Array]:
        """Where the charger belongs; native takes that at a reset, never later."""
        return {"goal": compose(state.pose("receptacle"), state.array(_HALF_TURN))}

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: near the plugged-in pose, in position and angle."""
        charger = state.pose("charger")
        distance = norm(self.memory.goal[:, :3] - charger[:, :3])
        angle = angle_between(self.memory.goal[:, 3:], charger[:, 3:])
        return {
            "obj_to_goal_dist": distance,
            "obj_to_goal_angle": angle,
            "success": (distance <= PLUGGED_DISTANCE) & (angle <= PLUGGED_ANGLE),
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP, charger, receptacle, and where the charger belongs."""
        return {
            "tcp_pose": state.tcp_pose("arm"),
            "charger_pose": state.pose("charger"),
            "receptacle_pose": state.pose("receptacle"),
            "goal_pose": self.memory.goal,
        }


# The charger plugs in facing the plate. The cosine of a quarter turn is 6e-17 in native, too.
_HALF_TURN = ((0.0, 0.0, 0.0, 6.123233995736766e-17, 0.0, 0.0, 1.0),)
