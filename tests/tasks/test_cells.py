"""What cells share: places before arms, what is inside something, what the instruction chooses."""

from contextlib import closing
from math import hypot, sqrt
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import layouts
import tasks
from robot_layouts.experts import find_expert
from tasks import CellTask
from tasks.cells.press_in_order import order_of
from tasks.cells.take_sides import SIDES
from tasks.language.fitting import AS_DECLARED
from tests.tasks.own import look, put

ARMS = ("first", "second", "third")
RING: Any = SimpleNamespace(
    layout=layouts.ring(dict.fromkeys(ARMS, "panda"), radius=0.8), fit=AS_DECLARED
)


@pytest.mark.parametrize("arm", ARMS)
def test_a_place_before_an_arm_is_on_the_way_to_it_or_to_the_right_of_that(arm: str):
    x, y, _ = RING.layout.arm(arm).base_position
    assert CellTask.before(RING, arm, hypot(x, y)) == pytest.approx((x, y))
    near, right = CellTask.before(RING, arm, 0.3), CellTask.before(RING, arm, 0.3, 0.1)
    assert np.subtract(right, near) == pytest.approx(0.1 * np.array((y, -x)) / hypot(x, y))


def test_what_is_inside_goes_by_the_frame_of_the_container():
    quarter = np.array([[1.0, 2.0, 0.0, sqrt(0.5), 0.0, 0.0, sqrt(0.5)]] * 2, np.float32)
    along = np.array([[1.0, 2.1, 0.0], [1.1, 2.0, 0.0]], np.float32)  # its own x is the world's y
    state: Any = SimpleNamespace(
        pose=lambda body: quarter, position=lambda body: along, array=np.float32
    )
    low, high = (-0.2, -0.05, -0.01), (0.2, 0.05, 0.01)
    inside = CellTask.is_within(RING, state, "cube", "tote", low, high)
    assert inside.tolist() == [True, False]


def test_the_instruction_says_what_counts_and_the_observation_does_not():
    env = tasks.make("CellThrowLevers-v1", num_envs=2)
    info = env.reset(seed=3)[1]  # environment i has seed 3 + i
    task: Any = env.task
    assert task.phrasings.tolist() == [3, 4]
    named = dict(zip(task.arms, task._named(env.state), strict=True))
    for i, words in enumerate(info["instruction"]):
        assert [arm for arm in task.arms if arm in words] == [a for a in task.arms if named[a][i]]
    assert {name.partition("_")[0] for name in env.observation_slices if "." not in name} == {
        *task.arms,
        "lever",
    }
    env.close()


def test_buttons_count_in_their_order_alone():
    env = tasks.make("CellPressInOrder-v1")
    env.reset(seed=1)  # from the south-east on, clockwise
    order, world = order_of(1), env.simulation.worlds[0]
    assert order[:3] == ("southeast", "south", "southwest")

    def press(pressed: str) -> Any:
        for arm in order:
            world.set_joints(f"button_{arm}", cap=0.008 if arm == pressed else 0.0)
        return env.task.evaluate(env.simulation.read())

    half = [press(arm)["are_half_pressed"].item() for arm in order[:4]]
    assert half == [False, False, False, True]
    assert not press(order[6])["is_first_pressed"].item()  # too early: it starts over
    assert [press(arm)["success"].item() for arm in order] == [False] * 7 + [True]
    env.close()


def test_cubes_are_swapped_once_both_lie_where_the_other_one_began():
    env = tasks.make("CellSwapPlaces-v1")
    env.reset(seed=0)
    start = {cube: env.state.position(cube)[0].tolist() for cube in ("red", "blue")}
    found = []
    for cube, other in (("red", "blue"), ("blue", "red")):
        found.append(env.task.evaluate(env.simulation.read())["success"].item())
        env.simulation.worlds[0].set_pose(cube, start[other])
    assert found == [False, False]
    assert env.task.evaluate(env.simulation.read())["success"].item()
    env.close()


@pytest.mark.parametrize(("side", "solved"), [(0, True), (1, False)])
def test_blocks_belong_on_the_side_that_is_told(side: int, solved: bool):
    env = tasks.make("CellTakeSides-v1")
    env.reset(seed=4)
    for arm, told in zip(env.layout.arms, SIDES[4], strict=True):
        mark = (told, {"left": "right", "right": "left"}[told])[side]
        x, y, _ = env.state.position(f"{mark}_{arm}")[0].tolist()
        env.simulation.worlds[0].set_pose(f"block_{arm}", (x, y, 0.025))
    assert env.task.evaluate(env.simulation.read())["success"].item() is solved
    env.close()


def test_the_instruction_says_in_which_order_cubes_are_stacked():
    with closing(tasks.make("CellStackInOrder-v1", num_envs=2)) as env:
        words = env.reset(seed=0)[1]["instruction"]
        assert ["red at the bottom, then green" in each for each in words] == [True, False]
        low, middle, high = (0.0, 0.0, 0.021), (0.0, 0.0, 0.061), (0.0, 0.0, 0.101)
        info = put(env, mark=(0.0, 0.0, 0.001), cube_red=low, cube_green=middle, cube_blue=high)
        assert info["success"].tolist() == [True, False]


def test_a_gear_counts_once_it_is_on_the_seat_of_its_own_shaft():
    with closing(tasks.make("CellMountGears-v1")) as env:
        env.reset(seed=0)
        seats = {
            arm: (*env.state.position(f"shaft_{arm}")[0, :2].tolist(), 0.0096)
            for arm in env.layout.arms
        }
        others = {f"gear_{arm}": seats[arm] for arm in ("first", "second")}
        assert put(env, **others)["are_two_on"].item()
        beside = tuple(np.add(seats["third"], (0.03, 0.0, 0.0)))
        assert not put(env, **others, gear_third=beside)["success"].item()
        assert put(env, **others, gear_third=seats["third"])["success"].item()


def test_cubes_belong_on_the_side_of_the_neighbour():
    with closing(tasks.make("CellCrossOver-v1")) as env:
        env.reset(seed=0)
        marks = {arm: env.state.position(f"mark_{arm}")[0, :2].tolist() for arm in env.layout.arms}
        across = {f"cube_{arm}": (*mark, 0.02) for arm, mark in marks.items()}
        own = across | {"cube_southwest": across["cube_southeast"]}
        own["cube_southeast"] = across["cube_southwest"]
        assert put(env, **across)["success"].item()
        info = put(env, **own)
        assert info["is_one_across"].item()
        assert not info["are_three_across"].item()


def test_a_ball_beside_the_board_is_not_on_it():
    with closing(tasks.make("CellBalanceBall-v1")) as env:
        actions = find_expert("CellBalanceBall-v1")(env, 0)
        env.reset(0, options={"reconfigure": True})
        solved = [env.step(action[None])[-1]["success"].item() for action in actions]
        assert solved[-1]
        x, y, z = env.state.position("board")[0].tolist()
        found = []
        for off in (0.0, 0.14):
            env.simulation.worlds[0].set_pose("ball", (x + off, y, z + 0.03))
            found.append(env.task.evaluate(env.simulation.read())["is_high"].item())
        assert found == [True, False]


@pytest.mark.parametrize(("first", "second", "solved"), [(0, 1, True), (1, 0, False)])
def test_raked_blocks_belong_in_the_box_of_their_side(first: int, second: int, solved: bool):
    with closing(tasks.make("CellRakeAndPlace-v1")) as env:
        info = env.reset(seed=0)[1]
        assert not info["are_near"].item()
        boxes = [env.state.position(f"box_{side}")[0, :2].tolist() for side in ("left", "right")]
        inside = {"block_left": (*boxes[first], 0.03), "block_right": (*boxes[second], 0.03)}
        info = put(env, **inside)
        assert info["are_near"].item()
        assert info["success"].item() is solved


@pytest.mark.parametrize(
    ("out", "beside", "stages"),
    [
        (0.15, 0.0, [True, True, False]),
        (0.0, 0.0, [False, True, True]),
        (0.0, 0.3, [False, False, False]),
    ],
)
def test_a_drawer_is_filled_once_it_is_shut_over_the_cube(
    out: float, beside: float, stages: list[bool]
):
    with closing(tasks.make("CellFillDrawer-v1")) as env:
        env.reset(seed=0)
        world = env.simulation.worlds[0]
        x, y, _ = env.state.position("case.drawer")[0].tolist()
        world.set_joints("case", drawer=out)  # towards the opener, along -y
        world.set_pose("cube", (x + beside, y - out, 0.05))
        info = env.task.evaluate(env.simulation.read())
        assert [info[flag].item() for flag in ("is_open", "is_inside", "success")] == stages


def test_the_button_counts_only_while_the_lever_is_thrown():
    with closing(tasks.make("CellUnlock-v1")) as env:
        env.reset(seed=0)
        world, found = env.simulation.worlds[0], []
        for lever, cap in ((-0.3, 0.008), (0.9, 0.0), (0.9, 0.008)):
            world.set_joints("lock", lever=lever)
            world.set_joints("button", cap=cap)
            found.append(look(env)["success"].item())
        assert found == [False, False, True]


def test_a_press_starts_when_both_buttons_are_pressed_and_the_loader_is_clear():
    with closing(tasks.make("CellTwoHandPress-v1")) as env:
        env.reset(seed=0)
        world, found = env.simulation.worlds[0], []
        x, y, z = env.state.tcp_position("loader")[0].tolist()
        for place in ((0.0, 0.0, 0.025), (x, y, z)):
            world.set_pose("die", place)
            world.set_pose("block", place)
            for left, right in ((0.006, 0.0), (0.0, 0.006), (0.006, 0.006)):
                world.set_joints("control", left=left, right=right)
                found.append(look(env)["success"].item())
        assert found == [False, False, True, False, False, False]


def test_latches_count_over_a_lid_that_is_shut():
    with closing(tasks.make("CellShutSuitcase-v1")) as env:
        env.reset(seed=0)
        world, found = env.simulation.worlds[0], []
        for lid, right in ((1.7, 0.0), (0.0, 0.044), (0.0, 0.0)):
            world.set_joints("case", lid=lid, left=0.0, right=right)
            found.append(look(env)["success"].item())
        assert found == [False, False, True]


@pytest.mark.parametrize(
    ("place", "reached"),
    [
        ("corner", [True, False, False]),
        ("end", [False, True, False]),
        ("box", [False, False, True]),
    ],
)
def test_a_block_is_passed_on_by_corner_and_end_into_the_box(place: str, reached: list[bool]):
    with closing(tasks.make("CellRelay-v1")) as env:
        env.reset(seed=0)
        x, y, _ = env.state.position(place)[0].tolist()
        info = put(env, block=(x, y, 0.025))
        assert [info[flag].item() for flag in ("is_at_corner", "is_at_end", "success")] == reached


def test_cubes_go_round_on_the_turntable_and_belong_in_the_box_of_their_colour():
    with closing(tasks.make("CellUnloadTurntable-v1")) as env:
        env.reset(seed=0)
        ahead, start = np.sign(-env.state.joint("turntable", "plate").item()), angles(env)
        still = np.zeros(env.action_space.shape)
        for _ in range(20):  # a second
            env.step(still)
        turned = ahead * (angles(env) - start) % (2 * np.pi)
        assert turned == pytest.approx(np.full(3, turned[0]), abs=0.01)
        assert 0.14 < turned[0] < 0.23
        boxes = {
            arm: (*env.state.position(f"box_{arm}")[0, :2].tolist(), 0.03)
            for arm in env.layout.arms
        }
        own = {f"cube_{arm}": place for arm, place in boxes.items()}
        swapped = own | {"cube_red": own["cube_blue"], "cube_blue": own["cube_red"]}
        assert not put(env, **swapped)["are_two_in"].item()
        assert put(env, **own)["success"].item()


def angles(env: tasks.TaskEnv) -> np.ndarray:
    """Return where the cubes are round the middle of the turntable (rad)."""
    places = [env.state.position(f"cube_{arm}")[0].tolist() for arm in env.layout.arms]
    return np.array([np.arctan2(y, x) for x, y, _ in places])


def test_the_bar_counts_behind_a_gate_that_is_shut_again():
    with closing(tasks.make("CellHoldGate-v1")) as env:
        env.reset(seed=0)
        world, found = env.simulation.worlds[0], []
        x, y, _ = env.state.position("mark")[0].tolist()
        for off, leaf in ((0.0, 1.4), (0.0, 0.05), (0.08, 0.05)):
            world.set_pose("bar", (x, y + off, 0.02))
            world.set_joints("gate", leaf=leaf)
            info = look(env)
            found.append([info[flag].item() for flag in ("is_open", "is_through", "success")])
        assert found == [[True, True, False], [False, True, True], [False, True, False]]


def test_brackets_count_once_they_hang_on_the_pegs_in_their_order():
    with closing(tasks.make("CellHangBrackets-v1")) as env:
        env.reset(seed=0)
        x, y, z, *turned = env.state.pose("pegs")[0].tolist()
        w, *_, s = turned
        seats = [(x, y, z + 0.012 + 0.008 * i, *turned) for i in range(3)]
        back = (*seats[1][:3], -s, 0.0, 0.0, w)  # half a turn on
        assert not put(env, red=seats[1], blue=seats[0], bar=seats[2])["are_two_on"].item()
        assert put(env, red=seats[0], blue=back)["are_two_on"].item()
        assert put(env, red=seats[0], blue=back, bar=seats[2])["success"].item()


def test_parts_belong_in_the_pockets_of_their_colours():
    with closing(tasks.make("CellPackKit-v1")) as env:
        env.reset(seed=0)
        pockets = [env.state.position(f"pocket_{arm}")[0].tolist() for arm in env.layout.arms]
        block, rod, stair, cross = ((x, y, z + 0.032) for x, y, z in pockets)
        info = put(env, block=rod, rod=block, stair=stair, cross=cross)
        assert info["are_two_in"].item()
        assert not info["are_three_in"].item()
        assert put(env, block=block, rod=rod)["success"].item()


def test_pegs_are_home_once_the_mallet_stands_on_its_mark_again():
    with closing(tasks.make("CellHammerPegs-v1")) as env:
        env.reset(seed=0)
        world, found = env.simulation.worlds[0], []
        x, y, _ = env.state.position("mark")[0].tolist()
        for arm in env.layout.arms:
            world.set_joints(f"block_{arm}", peg=0.026)
        for third, mallet in (
            (0.02, (x, y, 0.0)),
            (0.026, (x + 0.07, y, 0.0)),
            (0.026, (x, y, 0.03)),
            (0.026, (x, y, 0.0)),
        ):
            world.set_joints("block_third", peg=third)
            world.set_pose("mallet", mallet)
            found.append(look(env)["success"].item())
        assert found == [False, False, False, True]


def test_cubes_count_in_a_bin_while_it_is_held_up():
    with closing(tasks.make("CellFillHeldBin-v1")) as env:
        actions = find_expert("CellFillHeldBin-v1")(env, 0)
        env.reset(0, options={"reconfigure": True})
        solved = [env.step(action[None])[-1]["success"].item() for action in actions]
        assert solved[-1]
        world, cubes = env.simulation.worlds[0], ("cube_left", "cube_right")
        (x, y, z), found = env.state.position("bin")[0].tolist(), []
        for height, beside in ((z, 0.0), (z, 0.2), (0.05, 0.0)):
            world.set_pose("bin", (x, y, height), env.state.pose("bin")[0, 3:].tolist())
            for cube, off in zip(cubes, (beside, 0.0), strict=True):
                world.set_pose(cube, (x + off, y, height + 0.03))
            info = look(env)
            found.append([info[flag].item() for flag in ("is_one_in", "success")])
        assert found == [[True, True], [True, False], [False, False]]


def test_a_box_is_filled_once_its_lid_is_shut_over_both_cubes():
    with closing(tasks.make("CellOpenBox-v1")) as env:
        env.reset(seed=0)
        world, found = env.simulation.worlds[0], []
        x, y, _ = env.state.position("box")[0].tolist()
        for lid, beside in ((1.2, 0.0), (0.0, 0.0), (0.0, 0.3)):
            world.set_joints("box", lid=lid)
            world.set_pose("cube_left", (x + beside, y, 0.03))
            world.set_pose("cube_right", (x, y, 0.07))
            info = look(env)
            found.append([info[flag].item() for flag in ("is_open", "are_both_in", "success")])
        assert found == [[True, True, False], [False, True, True], [False, False, False]]


def test_each_peg_counts_in_the_socket_of_its_own_side():
    with closing(tasks.make("CellInsertPegs-v1")) as env:
        actions = find_expert("CellInsertPegs-v1")(env, 0)
        env.reset(0, options={"reconfigure": True})
        solved = [env.step(action[None])[-1]["success"].item() for action in actions]
        assert solved[-1]
        world, found = env.simulation.worlds[0], []
        left, right = (env.state.pose(f"peg_{arm}")[0].tolist() for arm in ("left", "right"))
        above = [*left[:2], left[2] + 0.03, *left[3:]]
        for first, second in ((above, right), (right, left), (left, right)):
            world.set_pose("peg_left", first[:3], first[3:])
            world.set_pose("peg_right", second[:3], second[3:])
            info = look(env)
            found.append([info[flag].item() for flag in ("is_one_in", "success")])
        assert found == [[True, False], [False, False], [True, True]]


@pytest.mark.parametrize(
    ("off", "up", "solved"), [(0.0, 0.03, True), (0.05, 0.03, False), (0.0, 0.06, False)]
)
def test_a_mug_counts_once_it_stands_on_the_trivet_on_its_mark(off: float, up: float, solved: bool):
    with closing(tasks.make("CellHandMugOn-v1")) as env:
        env.reset(seed=0)
        x, y, _ = env.state.position("mark")[0].tolist()
        spot = env.state.position("spot")[0, :2].tolist()
        info = put(env, mug=(*spot, 0.0))
        assert info["is_handed_on"].item()
        assert not put(env, mug=(x + off, y, up))["success"].item()  # the trivet is far
        info = put(env, trivet=(x, y, 0.015), mug=(x + off, y, up))
        assert info["success"].item() is solved


@pytest.mark.parametrize(("kept", "solved"), [(2, True), (1, False)])
def test_a_cup_is_served_with_both_balls_in_it(kept: int, solved: bool):
    with closing(tasks.make("CellPassGlass-v1")) as env:
        env.reset(seed=0)
        x, y, _ = env.state.position("mark")[0].tolist()
        balls = {"ball_one": (x - 0.0115, y, 0.016), "ball_two": (x + 0.0115, y, 0.016)}
        beside = {"ball_two": (x + 0.1, y, 0.011)} if kept < 2 else {}
        info = put(env, cup=(x, y, 0.0), **(balls | beside))
        assert [info["is_served"].item(), info["success"].item()] == [solved, False]
        env.simulation.worlds[0].set_joints("bell", cap=0.008)
        assert look(env)["success"].item() is solved


@pytest.mark.parametrize(
    ("aside", "up", "stages"),
    [
        (0.0, 0.11, [False, True]),
        (0.0, 0.14, [True, False]),
        (0.1, 0.14, [False, False]),
        (0.1, 0.06, [False, False]),
    ],
)
def test_a_box_belongs_on_the_plinth_with_the_tips_away(
    aside: float, up: float, stages: list[bool]
):
    with closing(tasks.make("CellSqueezeBox-v1")) as env:
        env.reset(seed=0)
        info = put(env, plinth=(0.0, -0.25, 0.025), box=(aside, -0.25, up))
        assert [info[flag].item() for flag in ("is_plinth_under", "success")] == stages
