"""CellServe: a robot on wheels brings a can, an arm serves it, and a stick rings the bell."""

from __future__ import annotations

from math import pi

from layouts import Layout, Placement
from tasks import Area, CellTask, Needs, Object, State, Target, is_at_rest, register_task
from tasks.maths import Array, Floats

RADIUS, PRESSED = 0.06, 0.005  # of the marks, and how far the bell's cap goes in (m)


@register_task("CellServe-v1")
class CellServe(CellTask):
    """Hand the can on over the hatch, stand it on the place, and ring.

    The can stands before the waiter, x in [-0.15, -0.05], y in [-0.2, -0.12]; the bell before the
    ringer, x in [-0.3, -0.2], y in [0.2, 0.3] (m). The waiter reaches the hatch, but not the place.

    Success: the can rests on its place, let go, while the bell is pressed by 5 mm.
    """

    instruction = (
        "Bring the can to the hatch, serve it, and ring the bell.",
        "Hand the can on until it stands on its place, then ring.",
        "Waiter, server, ringer: serve the can.",
    )
    layout = Layout(
        {
            "server": Placement("franka_panda", (0.6, 0.35, 0.0), rpy=(0.0, 0.0, -5 * pi / 6)),
            "waiter": Placement("fetch", (0.0, -0.68, 0.005), rpy=(0.0, 0.0, pi / 2)),
            "ringer": Placement("panda_stick", (-0.65, 0.375, 0.0), rpy=(0.0, 0.0, -pi / 6)),
        }
    )
    needs = {arm: Needs(fingers=True, opening=0.066) for arm in ("waiter", "server")} | {
        "ringer": Needs(reach=0.75)
    }
    max_episode_steps = 300
    stages = {"is_brought": 0.3, "is_held": 0.5, "is_served": 0.8, "success": 1.0}
    viewpoint = ((1.2, 1.2, 1.1), (0.0, 0.0, 0.1))

    hatch = Target(RADIUS, spawn=Area(x=0.06, y=-0.04))
    place = Target(RADIUS, spawn=Area(x=0.15, y=0.38))
    can = Object("can", spawn=Area(x=(-0.15, -0.05), y=(-0.2, -0.12)))
    bell = Object("button", kind="kinematic", spawn=Area(x=(-0.3, -0.2), y=(0.2, 0.3)))

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: served, and rung."""
        held = self.count([state.is_grasping(arm, "can") for arm in ("waiter", "server")])
        stands = is_at_rest(state, "can") & (held < 1)
        served = stands & (state.planar_distance("can", "place") <= RADIUS)
        return {
            "is_brought": stands & (state.planar_distance("can", "hatch") <= RADIUS),
            "is_held": state.is_grasping("server", "can"),
            "is_served": served,
            "success": served & (state.joint("bell", "cap") >= PRESSED),
        }

    def ways(self, state: State) -> list[Floats]:
        """Of the can to its place, of the server's hand to it, and of the stick to the bell."""
        tip = self.tip_distance(state, "ringer", "bell", (0.0, 0.0, 0.052))
        return [state.planar_distance("can", "place"), state.tcp_distance("server", "can"), tip]
