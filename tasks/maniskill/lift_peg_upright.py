"""LiftPegUpright: stand a lying peg on its end."""

from __future__ import annotations

from math import cos, pi, sin

from layouts import single
from tasks import (
    DARK_BLUE,
    DARK_RED,
    EpisodeRandom,
    Info,
    Peg,
    PhysicsSettings,
    State,
    World,
    closeness,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, Floats, where

# mani_skill 3.0.1, envs/tasks/tabletop/lift_peg_upright.py (m, rad)
PEG_HALF_WIDTH = 0.025
PEG_HALF_LENGTH = 0.12
SPAWN_HALF_SIZE = 0.1
LYING = (cos(pi / 4), sin(pi / 4), 0.0, 0.0)  # wxyz; a quarter turn about the peg's own axis
MAX_TILT = 0.08
MAX_LIFT = 0.005  # of the peg's centre from half its length


@register_task("LiftPegUpright-v1", "maniskill.lift_peg_upright_native")
class LiftPegUpright(Clone):
    """Stand a square peg, 24 cm long, upright on the table, either end up.

    The peg lies along x, its middle drawn from a square of 0.2 m around the origin. Success: the
    last of its Euler angles (about x, then y, then z) is within 0.08 rad of a quarter turn and its
    middle within 5 mm of half its length above the table.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/lift_peg_upright.py"
    layout = single({"arm": "panda"})
    physics = PhysicsSettings()
    max_episode_steps = 50
    max_reward = 3

    peg = Peg(PEG_HALF_LENGTH, PEG_HALF_WIDTH, DARK_RED, DARK_BLUE, start=(0.0, 0.0, 0.1))

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Lay the peg on the table."""
        x, y = (rng.uniform(1, 2) * (SPAWN_HALF_SIZE * 2) - SPAWN_HALF_SIZE)[0].tolist()
        world.set_pose("peg", (x, y, PEG_HALF_WIDTH), LYING)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: upright and standing on the table."""
        # Native judges uprightness by one Euler angle, although that angle is a quarter turn, too,
        # while the peg lies along y.
        upright = abs(abs(state.last_euler_angle("peg")) - pi / 2) < MAX_TILT
        return {"success": upright & (_lift(state) < MAX_LIFT)}

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """TCP and peg."""
        return {"tcp_pose": state.tcp_pose("arm"), "obj_pose": state.pose("peg")}

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Turn (1), lift (1), reach or grasp (1/5); 3 on success."""
        turned = abs(state.rotation("peg")[:, 2, 0])  # how vertical the peg's own axis is
        lifted, reach = closeness(_lift(state), state.tcp_distance("arm", "peg"))
        held = where(state.is_grasping("arm", "peg"), 1.0, reach)
        return where(info["success"], 3.0, turned + lifted + held / 5.0)


def _lift(state: State) -> Floats:
    """How far the peg's middle is from where it is when the peg stands, (N,) (m)."""
    return abs(state.position("peg")[:, 2] - PEG_HALF_LENGTH)
