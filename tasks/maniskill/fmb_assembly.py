"""FMBAssembly1Easy: turn a bridge upright, with a fixture's help, and lay it across an assembly."""

from __future__ import annotations

from math import sqrt

from layouts import single
from robots.assets.locator import ASSEMBLY, FileLocator
from tasks import (
    Compound,
    EpisodeRandom,
    Mesh,
    PhysicsSettings,
    Quaternion,
    State,
    Vector3,
    World,
    register_task,
)
from tasks.maniskill.clone import Clone
from tasks.maths import Array, norm, rounded

# mani_skill 3.0.1, envs/tasks/fmb/fmb.py (m)

PLACES: dict[str, Vector3] = {  # of the parts that are in place
    "board": (0.115, 0.115, 0.034444),
    "yellow_peg": (0.115, 0.115, 0.0585),
    "purple_u": (0.115, 0.047, 0.06375),
    "blue_u": (0.115, 0.183, 0.06375),
}
BRIDGE_PLACE = (0.115, 0.115, 0.048667)  # where the bridge belongs
HALF_ROOT = sqrt(0.5)
OFFSET, QUARTER_TURN = (0.02, -0.115, 0.0), (HALF_ROOT, 0.0, 0.0, HALF_ROOT)  # from all of these
FIXTURE_PLACE = (0.05, 0.25, 0.0285)
SPAWN, SPAWN_HALF_WIDTH = (-0.13, 0.23), 0.025  # of the bridge: x and y around there
LYING_HEIGHT, LYING = 0.048667 / 2, (0.5, 0.5, -0.5, 0.5)
GRASP_Y = -0.03  # from the bridge as it lies; along its own z axis
PLACED_DISTANCE = 0.005

# The files' y axes point up.
UPRIGHT, UPRIGHT_TURNED = (HALF_ROOT, HALF_ROOT, 0.0, 0.0), (0.5, 0.5, 0.5, 0.5)


def _drawn(name: str) -> Mesh:
    """Return what is seen of a part."""
    file = FileLocator(ASSEMBLY, f"{name}.glb")
    return Mesh(file, quaternion=UPRIGHT, textured=True, collides=False)


def _fixed(name: str, quaternion: Quaternion) -> Compound:
    """Return a body that holds others in its hollows."""
    file = FileLocator(ASSEMBLY, f"{name}.glb")
    mesh = Mesh(file, quaternion=quaternion, textured=True, collision="surface")
    return Compound((mesh,), kind="kinematic")


def _angular(name: str) -> Compound:
    """Return a body of several boxes, which lie in a file of their own."""
    boxes = Mesh(FileLocator(ASSEMBLY, f"{name}.ply"), collision="pieces", visible=False)
    return Compound((boxes, _drawn(name)))


@register_task("FMBAssembly1Easy-v1", "maniskill.fmb_assembly_native")
class FMBAssembly1Easy(Clone):
    """Lay the green bridge across the yellow peg, where it belongs on the red board.

    All other parts are in place: the peg lies on the board, and a purple and a blue U stand beside
    it. The bridge lies on its side next to the black fixture, in which it can be put down and
    grasped anew, with x and y within 2.5 cm of (-0.13, 0.23) m. Success: it is within 5 mm of its
    place. Nothing is observed but the robot.
    """

    source = "mani_skill 3.0.1, envs/tasks/fmb/fmb.py"
    layout = single({"arm": "panda"})
    physics = PhysicsSettings()
    max_episode_steps = 500
    viewpoint = ((1.0, 0.8, 0.8), (0.0, 0.0, 0.35))

    board = _fixed("board_1", UPRIGHT)
    yellow_peg = Compound(
        (Mesh(FileLocator(ASSEMBLY, "yellow_peg.glb"), quaternion=UPRIGHT, textured=True),)
    )
    purple_u = _angular("purple_u")
    blue_u = _angular("blue_u")
    green_bridge = _angular("green_bridge")
    reorienting_fixture = _fixed("reorienting_fixture", UPRIGHT_TURNED)

    def build(self, world: World) -> None:
        """Add the parts, and a frame that native keeps where the bridge should be grasped."""
        super().build(world)
        world.add("bridge_grasp", kind="kinematic")

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Put all in place but the bridge, which lies somewhere beside the fixture."""
        for name, place in PLACES.items():
            world.set_pose(name, _in_assembly(place), QUARTER_TURN)
        world.set_pose("reorienting_fixture", FIXTURE_PLACE)
        off = rng.uniform_between((-SPAWN_HALF_WIDTH,) * 2, (SPAWN_HALF_WIDTH,) * 2)
        x, y = (_sum(middle, away) for middle, away in zip(SPAWN, off.tolist(), strict=True))
        world.set_pose("green_bridge", (x, y, LYING_HEIGHT), LYING)
        world.set_pose("bridge_grasp", (x, _sum(y, GRASP_Y), LYING_HEIGHT), LYING)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Success: the bridge is where it belongs."""
        off = state.position("green_bridge") - state.array(_BRIDGE_GOAL)
        return {"success": norm(off) < PLACED_DISTANCE}


def _in_assembly(place: Vector3) -> Vector3:
    """Return where a part in its place is (m)."""
    x, y, z = map(_sum, place, OFFSET)
    return x, y, z


def _sum(one: float, other: float) -> float:
    """Return a sum as native's single precision rounds it."""
    return rounded(rounded(one) + rounded(other))


_BRIDGE_GOAL = (_in_assembly(BRIDGE_PLACE),)
