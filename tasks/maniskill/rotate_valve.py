"""RotateValve: turn a valve with three fingers that hang over it; five levels of difficulty."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import pi, sqrt
from typing import ClassVar

from layouts import Layout, Placement
from layouts.placement import load_robot
from tasks import (
    WHITE,
    Box,
    Camera,
    Capsule,
    Color,
    Cylinder,
    EpisodeRandom,
    Finish,
    Friction,
    Info,
    Joint,
    PhysicsSettings,
    Quaternion,
    Shape,
    State,
    World,
    add_table,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Floats, clip, cos, norm, sin, tanh
from tasks.native.rotations import about_z, along_ray

# mani_skill 3.0.1, utils/building/articulations/robel.py (m)
SPOKE_HEIGHT = 0.039854  # over the mount
SPOKE_LENGTH, SPOKE_RADIUS = 0.061706, 0.0195
MOUNT_WIDTH, MOUNT_HEIGHT = 0.04, 0.03
AXIS_HEIGHT = SPOKE_HEIGHT + MOUNT_HEIGHT
BEARING_RADIUS, BEARING_HEIGHT = 0.007, 0.032
FACTOR_SPREAD = 0.1  # standard deviation of the factors on length and radius of spokes
ON_END: Quaternion = (-0.707, 0.0, 0.707, 0.0)  # native's digits: pictures depend on its length
DOWN: Quaternion = (sqrt(0.5), 0.0, sqrt(0.5), 0.0)  # native's 0.707, as PhysX scales it
RUBBER = Friction(1.0, 0.8, 0.0)
SATIN = Finish(roughness=0.5, specular=0.5)
RED: Color = (1.0, 0.0, 0.0, 1.0)

# mani_skill 3.0.1, envs/tasks/dexterity/rotate_valve.py (m, rad)
SPOKES = (3, 6)  # at least, fewer than
LEAST_GAP, TRIALS = pi / 6, 500
HALF_SPAWN = 0.02  # of x and y
YAW = (pi / 6, pi * 5 / 6)
BASE_HEIGHT = 0.28
START = (0.7, -0.7, -0.7, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
TIP_OFFSET = 0.01  # from a spoke's end to where the tips should be, towards the axis

VALVE, TURN = "valve_station_0", "valve"


@dataclass(frozen=True)
class ValveDesign:
    """Geometry of a valve.

    Attributes:
        angles: Where its spokes point, seen from above (rad).
        length: Of a spoke's straight part, from the axis (m).
        radius: Half a spoke's thickness (m).
    """

    angles: tuple[float, ...]
    length: float = SPOKE_LENGTH
    radius: float = SPOKE_RADIUS

    def mount(self) -> tuple[Shape, ...]:
        """Return the block that stands on the table, and the bearing on it."""
        block = Box(
            half_size=(MOUNT_WIDTH / 2, MOUNT_WIDTH / 2, MOUNT_HEIGHT / 2),
            position=(0.0, 0.0, MOUNT_HEIGHT / 2),
            color=WHITE,
        )
        bearing = Cylinder(
            radius=BEARING_RADIUS,
            half_length=MOUNT_HEIGHT / 2,
            position=(0.0, 0.0, MOUNT_HEIGHT + BEARING_HEIGHT / 2),
            quaternion=ON_END,
            color=WHITE,
        )
        return block, bearing

    def spokes(self) -> tuple[Capsule, ...]:
        """Return the spokes, in the valve's frame with its joint at zero; the first one is red."""
        first, *others = self.angles
        return (self._spoke(first, RED), *(self._spoke(angle, WHITE) for angle in others))

    def _spoke(self, angle: float, color: Color) -> Capsule:
        middle, quaternion = along_ray(angle, self.length / 2)
        return Capsule(
            radius=self.radius,
            half_length=self.length / 2,
            position=(*middle, AXIS_HEIGHT),
            quaternion=quaternion,
            friction=RUBBER,
            patch_radius=0.1,
            min_patch_radius=0.03,
            color=color,
            finish=SATIN,
        )

    def joint(self) -> Joint:
        """Return what turns the spokes: clockwise, seen from above, as native's axis points down.

        It is not native's 0.02 that resists, which native's builder never sets, but what PhysX
        takes for any joint.
        """
        return Joint(
            name=TURN,
            kind="turn",
            parts=self.spokes(),
            axis=(0.0, 0.0, -1.0),
            axes=DOWN,
            at=(0.0, 0.0, AXIS_HEIGHT),
            origin=(0.0, 0.0, AXIS_HEIGHT),
            lower=None,
            upper=None,
            friction=0.05,
            damping=2.0,
        )


def drawn_angles(count: int, rng: EpisodeRandom) -> tuple[float, ...]:
    """Draw where spokes point, rising (rad).

    No two are nearer than 30°, and the last one is as far from a full turn; of spokes for which no
    such angles are found in 500 trials, the gaps are equal.

    Args:
        count: Number of spokes.
        rng: Draws them from its numpy stream.
    """
    for _ in range(TRIALS):
        angles = sorted(rng.numpy.uniform(0, 2 * pi, count).tolist())
        gaps = (after - angle for angle, after in pairwise((*angles, 2 * pi)))
        if min(gaps) >= LEAST_GAP:
            return tuple(angles)
    return even_angles(count)


def even_angles(count: int) -> tuple[float, ...]:
    """Return where so many spokes point if the gaps are equal (rad)."""
    return tuple(i * (2 * pi / count) for i in range(count))


class RotateValve(Clone):
    """What all five levels share.

    Attributes:
        turned: How far the valve has to be turned (rad).
    """

    source = "mani_skill 3.0.1, envs/tasks/dexterity/rotate_valve.py"
    layout = Layout(
        {
            "arm": Placement(
                load_robot("dclaw"), (0.0, 0.0, BASE_HEIGHT), (0.0, 0.0, -1.0, 0.0), qpos=START
            )
        }
    )
    physics = PhysicsSettings()
    max_episode_steps = 150
    max_reward = 6.0
    double_rewards = True
    viewpoint = ((0.2, 0.4, 0.4), (0.0, 0.0, 0.1))
    cameras = (Camera((0.3, 0.0, 0.3), (-0.1, 0.0, 0.05)),)
    sensed = ("rotate_dir", "valve_qpos", "valve_qvel", "valve_x", "valve_y")
    turned: ClassVar[float] = pi

    def design(self, rng: EpisodeRandom) -> ValveDesign:
        """Draw three to five spokes."""
        return ValveDesign(drawn_angles(rng.numpy.randint(*SPOKES), rng))

    def direction(self, rng: EpisodeRandom) -> float:
        """Return which way the valve is to be turned: 1 where its joint's position rises, or -1."""
        return 1.0

    def build(self, world: World) -> None:
        """Add the table and the valve."""
        add_table(world)
        design: ValveDesign = world.design
        world.add(VALVE, *design.mount(), kind="kinematic", joints=(design.joint(),))

    def reset_robots(self, world: World, rng: EpisodeRandom) -> None:
        """Leave the fingers to `sample`: native draws their noise last, from the torch stream."""

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the valve on the table, turned by any angle, and then the fingers over it."""
        world.notes["direction"] = self.direction(rng)
        x, y = rng.torch_uniform(-HALF_SPAWN, HALF_SPAWN, 2).tolist()
        world.set_pose(VALVE, (x, y, 0.0), about_z(rng.torch_uniform(*YAW, 1)))
        angle = rng.uniform(1, 1) * pi * 2 - pi
        world.set_joints(VALVE, **{TURN: angle.item()})
        for name, placement in world.layout.items():
            noise = rng.torch_standard_normal(placement.robot.dof) * placement.qpos_noise
            self.stand(world, name, noise.numpy())

    def remember(self, state: State) -> dict[str, Array]:
        """Where the valve began, which way it is to be turned, and how long its spokes are."""
        worlds = self.simulation.worlds
        return {
            "start": state.joint(VALVE, TURN),
            "direction": state.array([world.notes["direction"] for world in worlds]),
            "lengths": state.doubles([world.design.length for world in worlds]),
        }

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: turned far enough."""
        rotation = state.joint(VALVE, TURN) - self.memory.start
        return {
            "success": rotation * self.memory.direction > self.turned,
            "valve_rotation": rotation,
        }

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Which way to turn, how far the valve is turned, and where it stands."""
        position = state.joint(VALVE, TURN)
        return {
            "rotate_dir": self.memory.direction,
            "valve_qpos": position[:, None],
            "valve_qvel": state.joint_velocity(VALVE, TURN)[:, None],
            "valve_x": cos(position),
            "valve_y": sin(position),
            "valve_pose": state.pose(VALVE),
        }

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Keep the tips at the spokes' ends (1), turn the valve (4) and have turned it (1).

        What was turned counts by the joint's position, whichever way it is to be turned.
        """
        tips = self.agent_tip_positions(state, "arm")[:, :, :2]
        off_axis = norm(tips - state.position(f"{VALVE}.{TURN}")[:, None, :2])
        error = norm(off_axis - (self.memory.lengths[:, None] - TIP_OFFSET))
        speed = state.joint_velocity(VALVE, TURN) * self.memory.direction
        turned = clip(info["valve_rotation"] / pi / 2.0, -1.0, 1.0)
        return 1.0 - tanh(error * 10.0) + tanh(5.0 * speed) * 4.0 + turned


@register_task("RotateValveLevel0-v1", "maniskill.rotate_valve_level0_native")
class RotateValveLevel0(RotateValve):
    """Turn a valve of three even spokes by a quarter turn, with three fingers that hang over it.

    The valve stands within 2 cm of the middle and is turned by any angle. Success: its joint has
    turned by more than 90° since the episode began.
    """

    max_episode_steps = 80
    turned = pi / 2

    def design(self, rng: EpisodeRandom) -> ValveDesign:
        """Three even spokes."""
        return ValveDesign((0.0, pi / 3 * 2, pi / 3 * 4))


@register_task("RotateValveLevel1-v1", "maniskill.rotate_valve_level1_native")
class RotateValveLevel1(RotateValve):
    """Turn a valve of three even spokes by half a turn, with three fingers that hang over it.

    The valve stands within 2 cm of the middle and is turned by any angle. Native gives valves of
    three, four and five spokes to environments that share a GPU; one on a CPU, as each is here,
    always has three. Success: its joint has turned by more than 180° since the episode began.
    """

    def design(self, rng: EpisodeRandom) -> ValveDesign:
        """Three even spokes."""
        return ValveDesign(even_angles(3))


@register_task("RotateValveLevel2-v1", "maniskill.rotate_valve_level2_native")
class RotateValveLevel2(RotateValve):
    """Turn a valve of uneven spokes by half a turn, with three fingers that hang over it.

    It has three to five spokes, at least 30° apart, which are drawn when worlds are built, not at
    every reset. The valve stands within 2 cm of the middle and is turned by any angle. Success: its
    joint has turned by more than 180° since the episode began.
    """


@register_task("RotateValveLevel3-v1", "maniskill.rotate_valve_level3_native")
class RotateValveLevel3(RotateValve):
    """Turn a valve of uneven spokes of any size by half a turn, with three fingers over it.

    It has three to five spokes, at least 30° apart, about 6 cm long and 4 cm thick, give or take a
    tenth, which are drawn when worlds are built, not at every reset. The valve stands within 2 cm
    of the middle and is turned by any angle. Success: its joint has turned by more than 180° since
    the episode began.
    """

    def design(self, rng: EpisodeRandom) -> ValveDesign:
        """Draw spokes, their length and their thickness."""
        angles = super().design(rng).angles
        length, radius = (rng.numpy.randn(2) * FACTOR_SPREAD + 1).tolist()
        return ValveDesign(angles, SPOKE_LENGTH * length, SPOKE_RADIUS * radius)


@register_task("RotateValveLevel4-v1", "maniskill.rotate_valve_level4_native")
class RotateValveLevel4(RotateValveLevel3):
    """Turn a valve of uneven spokes of any size by a whole turn, one way or the other.

    It has three to five spokes, at least 30° apart, about 6 cm long and 4 cm thick, give or take a
    tenth, which are drawn when worlds are built, not at every reset. The valve stands within 2 cm
    of the middle and is turned by any angle; which way it is to be turned is drawn and observed.
    Success: its joint has turned by more than 360° that way since the episode began. As in native,
    its position stays within 360° of zero, so that only those episodes can be solved in which the
    way leads through zero.
    """

    max_episode_steps = 300
    turned = 2 * pi

    def direction(self, rng: EpisodeRandom) -> float:
        """Draw which way the valve is to be turned."""
        return 1.0 - rng.torch_whole(0, 2) * 2
