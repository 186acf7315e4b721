"""Distances that presets choose: whichever robots of the catalogue stand there, they keep clear."""

import itertools
import random
import sys
from collections.abc import Callable, Sequence

import pytest

from layouts import Layout, around_table, at_task, face_to_face, grid, ring, side_by_side
from layouts.distances import apart
from layouts.shared_place import shared_place
from robots import LayoutError, RobotDescriptor, RobotRegistry
from tasks.originals.relay import find_zones
from tests.layouts import small_robots
from tests.quick import quick_cases
from tests.robots.urdf_parts import Parts

CLEAR = 0.05  # m, at the keyframes with joint noise

WAYS: dict[str, Callable[[dict[str, str]], Layout]] = {
    "row": lambda robots: side_by_side(robots, spacing="auto"),
    "ring": ring,
    "ring along": lambda robots: ring(robots, facing="tangent"),
    "grid": grid,
    "table": around_table,
    "corner": lambda robots: around_table(
        robots, edges=[("south", "east", "east")[i % 3] for i in range(len(robots))]
    ),
}


ROBOTS = ("fetch", "floating_panda_gripper", "koch", "mobile_panda", "panda", "panda_pinch",
          "panda_stick", "panda_wristcam", "so100", "xarm7")  # fmt: skip


def clearance(way: Callable[[dict[str, str]], Layout], mix: Sequence[str]) -> float:
    """Return the least distance of any two robots, with joint noise (m)."""
    layout = way({f"arm_{i}": robot for i, robot in enumerate(mix)})
    clearances = layout.validate(workspaces=False, samples=10).clearances
    return min(between.noisy_distance for between in clearances if not between.table)


def mixes(count: int, seed: int) -> list[list[str]]:
    """Draw some mixes of three to five robots."""
    draw = random.Random(seed)
    return [draw.choices(ROBOTS, k=draw.randint(3, 5)) for _ in range(count)]


SIZES = ("panda-panda_stick-so100", "panda_stick-fetch-koch-fetch")
OTHER_SIZES = (
    "panda-panda-panda-panda",
    "panda-so100-panda_stick",
    "fetch-koch-koch-fetch",
    *map("-".join, mixes(3, seed=0)),
)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("mix", quick_cases(SIZES + OTHER_SIZES, SIZES))
def test_robots_keep_clear(way, mix):
    assert clearance(WAYS[way], mix.split("-")) >= CLEAR


IN_A_RING = [*itertools.product(("panda", "koch", "fetch"), repeat=3)]


@pytest.mark.parametrize(
    ("one", "two", "three"),
    quick_cases(IN_A_RING, [mix for mix in IN_A_RING if mix == (*sorted(mix),)]),
)
def test_in_a_ring_a_relay_finds_a_place_between_any_two(one, two, three):
    assert len(find_zones(ring({"a": one, "b": two, "c": three}))) == 3


def wide(folder, width=2.4) -> RobotDescriptor:
    """A small robot whose body is wider than its reach is long."""
    plate = small_robots.link("top", f'<box size="{width} {width} 0.1"/>')
    text = small_robots.TURNTABLE.replace(small_robots.link("top"), plate)
    assert plate in text
    return small_robots.robot(folder, text, ["turn"])


@pytest.mark.parametrize("way", [*WAYS, "face"])
def test_bodies_that_are_larger_than_their_reach_stand_farther_apart(way, tmp_path):
    robot = wide(tmp_path)
    ways = {**WAYS, "face": lambda robots: face_to_face(robots, spacing="auto")}
    layout = ways[way]({"left": robot, "right": "panda"})
    assert layout.validate(workspaces=False).ok
    (x, y, _), (u, v, _) = (place.base_position for place in layout.values())
    assert 0 < (x - u) ** 2 + (y - v) ** 2 < 3.0**2


def test_the_distance_is_that_of_the_finding_and_leaves_hands_room_to_set_out(tmp_path):
    robots = {"left": wide(tmp_path), "right": "panda"}
    reach = apart(robots["left"], RobotRegistry.load("panda"))
    by_reach = side_by_side(robots, spacing=reach)
    (finding,) = [f for f in by_reach.validate(workspaces=False).findings if f.serious]
    assert finding.farther is not None
    assert f"{finding.farther:.3f} m farther apart" in finding.advice
    layout = side_by_side(robots, spacing="auto")
    left, right = (place.base_position[1] for place in layout.values())
    assert right - left >= reach + finding.farther
    (clearance,) = layout.validate(workspaces=False, samples=20).clearances
    assert CLEAR <= clearance.noisy_distance < CLEAR + 0.02


def test_where_no_distance_helps_it_says_why(tmp_path):
    robots = {"left": wide(tmp_path, 9.0), "right": "panda"}
    with pytest.raises(
        LayoutError, match=r"no distance keeps these robots apart(.|\n)*left and right"
    ):
        side_by_side(robots, spacing="auto")


def test_a_robot_that_touches_itself_is_refused(tmp_path):
    folded = small_robots.robot(
        tmp_path, small_robots.FOLDING, ["shoulder", "elbow"], [0.0, 3.1], "lower"
    )
    with pytest.raises(
        LayoutError, match=r"no distance makes this layout sound(.|\n)*touches itself"
    ):
        side_by_side({"left": folded, "right": "panda"}, spacing="auto")


def test_without_fcl_the_distance_is_that_of_reach(tmp_path, monkeypatch):
    robots = {"left": wide(tmp_path), "right": "panda"}
    monkeypatch.setitem(sys.modules, "fcl", None)
    reach = apart(robots["left"], RobotRegistry.load("panda"))
    assert side_by_side(robots, spacing="auto") == side_by_side(robots, spacing=reach)


def on_a_wheel(folder, height: float) -> RobotDescriptor:
    """A small robot with a wheel whose middle is so high above its base (m), and 0.1 m large."""
    wheel = small_robots.link("wheel", xyz=f"0 0 {height}")
    parts = wheel + small_robots.joint("roll", "base", "wheel") + "</robot>"
    text = small_robots.TURNTABLE.replace("</robot>", parts)
    return small_robots.robot(folder, text, ["turn", "roll"])


@pytest.mark.parametrize("way", [side_by_side, face_to_face, ring, grid, around_table])
def test_a_robot_stands_on_its_wheels_beside_one_that_stands_on_its_base(way, tmp_path):
    robots = {"left": on_a_wheel(tmp_path, 0.03), "right": "panda"}
    layout = way(robots) if way in (ring, around_table) else way(robots, spacing="auto")
    heights = [placement.local_pose.position[2] for placement in layout.values()]
    assert heights == [pytest.approx(0.0205, abs=6e-4), 0.0]
    assert not [f for f in layout.validate(workspaces=False, table=(-2.0, -2.0, 2.0, 2.0)).findings]


def test_a_robot_on_high_legs_is_not_raised(tmp_path):
    robots = {"left": on_a_wheel(tmp_path, -0.3), "right": "panda"}
    assert side_by_side(robots, spacing="auto")["left"].base_position[2] == 0.0


def test_at_a_task_a_robot_stands_on_its_wheels(tmp_path):
    task = face_to_face({"left": "panda", "right": "panda"}, spacing=1.5)
    layout = at_task({"left": on_a_wheel(tmp_path, 0.03)}, task)
    assert layout["left"].base_position[2] == pytest.approx(0.0205, abs=6e-4)
    assert layout["right"] == task["right"]


def test_a_hand_without_an_arm_stands_beside_one_that_reaches_the_ground(tmp_path):
    parts = Parts()
    parts.jaws(parts.link("base_link", 5.0, "0.1 0.1 0.1", "0 0 0.05"), "a")
    hand = RobotDescriptor.from_urdf(parts.write(tmp_path))
    assert hand.fingers is not None
    assert side_by_side({"hand": hand, "arm": "panda"}, spacing="auto").validate().ok


@pytest.mark.long
def test_robots_of_tall_bodies_stoop_and_come_near_enough_to_work_together():
    layout = face_to_face({"left": "fetch", "right": "fetch"})
    robot = layout["left"].robot
    assert layout["left"].start_qpos[robot.joints.index("torso_lift_joint")] == 0.0
    assert layout["left"].base_position[2] == pytest.approx(0.005)
    assert layout["right"].base_position[1] < apart(robot, robot) / 2
    shared = shared_place(layout, ("left", "right"), height=0.2)
    assert shared is not None
    assert shared[1] > 0.14 * robot.reach
    assert layout.validate(workspaces=False, table=(-2.0, -2.0, 2.0, 2.0)).ok
