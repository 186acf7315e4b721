"""What cells share: places before arms, what is inside something, what the instruction chooses."""

from contextlib import ExitStack, closing
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
from tests.tasks.own import make, put, told

ARMS = ("first", "second", "third")
RING: Any = SimpleNamespace(
    layout=layouts.ring(dict.fromkeys(ARMS, "panda"), radius=0.8), fit=AS_DECLARED
)


@pytest.fixture
def cell():
    """A task of cells by name, in its first episode."""
    with ExitStack() as stack:
        yield lambda name: stack.enter_context(closing(make(f"Cell{name}-v1")))


def place(env: tasks.TaskEnv, body: str, *height: float) -> tuple[float, ...]:
    """Return where something is, at another height."""
    x, y, z = env.state.position(body)[0].tolist()
    return (x, y, *(height or (z,)))


def solve(env: tasks.TaskEnv, name: str) -> None:
    """Let the expert solve the first episode."""
    actions = find_expert(f"Cell{name}-v1")(env, 0)
    env.reset(0, options={"reconfigure": True})
    assert [env.step(action[None])[-1]["success"].item() for action in actions][-1]


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
    with closing(tasks.make("CellThrowLevers-v1", num_envs=2)) as env:
        info = env.reset(seed=3)[1]  # environment i has seed 3 + i
        task: Any = env.task
        assert task.phrasings.tolist() == [3, 4]
        named = dict(zip(task.arms, task._named(env.state), strict=True))
        for i, words in enumerate(info["instruction"]):
            assert [a for a in task.arms if a in words] == [a for a in task.arms if named[a][i]]
        observed = {name.partition("_")[0] for name in env.observation_slices if "." not in name}
        assert observed == {*task.arms, "lever"}


def test_buttons_count_in_their_order_alone(cell):
    env = cell("PressInOrder")
    env.reset(seed=1)  # from the south-east on, clockwise
    order = order_of(1)
    assert order[:3] == ("southeast", "south", "southwest")

    def press(pressed: str, flag: str = "success") -> bool:
        caps = {f"button_{arm}": {"cap": 0.008 if arm == pressed else 0.0} for arm in order}
        return told(env, flag, [caps])[0][0]

    half = [press(arm, "are_half_pressed") for arm in order[:4]]
    assert half == [False, False, False, True]
    assert not press(order[6], "is_first_pressed")  # too early: it starts over
    assert [press(arm) for arm in order] == [False] * 7 + [True]


def test_cubes_are_swapped_once_both_lie_where_the_other_one_began(cell):
    env = cell("SwapPlaces")
    red, blue = place(env, "red"), place(env, "blue")
    scenes = [{"red": red}, {"red": blue}, {"blue": red}]
    assert told(env, "success", scenes) == [[False], [False], [True]]


def test_blocks_belong_on_the_side_that_is_told(cell):
    env = cell("TakeSides")
    env.reset(seed=4)
    other = {"left": "right", "right": "left"}
    sides = dict(zip(env.layout.arms, SIDES[4], strict=True))
    scenes = [
        {f"block_{arm}": place(env, f"{each[arm]}_{arm}", 0.025) for arm in sides}
        for each in (sides, {arm: other[side] for arm, side in sides.items()})
    ]
    assert told(env, "success", scenes) == [[True], [False]]


def test_the_instruction_says_in_which_order_cubes_are_stacked():
    with closing(tasks.make("CellStackInOrder-v1", num_envs=2)) as env:
        words = env.reset(seed=0)[1]["instruction"]
        assert ["red at the bottom, then green" in each for each in words] == [True, False]
        low, middle, high = (0.0, 0.0, 0.021), (0.0, 0.0, 0.061), (0.0, 0.0, 0.101)
        info = put(env, mark=(0.0, 0.0, 0.001), cube_red=low, cube_green=middle, cube_blue=high)
        assert info["success"].tolist() == [True, False]


def test_a_gear_counts_once_it_is_on_the_seat_of_its_own_shaft(cell):
    env = cell("MountGears")
    seats = {f"gear_{arm}": place(env, f"shaft_{arm}", 0.0096) for arm in env.layout.arms}
    third = seats.pop("gear_third")
    beside = tuple(np.add(third, (0.03, 0.0, 0.0)))
    scenes = [seats, {"gear_third": beside}, {"gear_third": third}]
    assert told(env, "are_two_on success", scenes) == [[True, False], [True, False], [True, True]]


def test_cubes_belong_on_the_side_of_the_neighbour(cell):
    env = cell("CrossOver")
    across = {f"cube_{arm}": place(env, f"mark_{arm}", 0.02) for arm in env.layout.arms}
    own = across | {"cube_southwest": across["cube_southeast"]}
    own["cube_southeast"] = across["cube_southwest"]
    found = told(env, "is_one_across are_three_across success", [across, own])
    assert found == [[True, True, True], [True, False, False]]


def test_a_ball_beside_the_board_is_not_on_it(cell):
    env = cell("BalanceBall")
    solve(env, "BalanceBall")
    x, y, z = place(env, "board")
    scenes = [{"ball": (x + off, y, z + 0.03)} for off in (0.0, 0.14)]
    assert told(env, "is_high", scenes) == [[True], [False]]


def test_raked_blocks_belong_in_the_box_of_their_side(cell):
    env = cell("RakeAndPlace")
    left, right = (place(env, f"box_{side}", 0.03) for side in ("left", "right"))
    scenes = [
        {},
        {"block_left": right, "block_right": left},
        {"block_left": left, "block_right": right},
    ]
    found = told(env, "are_near success", scenes)
    assert found == [[False, False], [True, False], [True, True]]


def test_a_drawer_is_filled_once_it_is_shut_over_the_cube(cell):
    env = cell("FillDrawer")
    x, y, _ = place(env, "case.drawer")
    scenes = [  # it opens towards the opener, along -y
        {"case": {"drawer": out}, "cube": (x + beside, y - out, 0.05)}
        for out, beside in ((0.15, 0.0), (0.0, 0.0), (0.0, 0.3))
    ]
    found = told(env, "is_open is_inside success", scenes)
    assert found == [[True, True, False], [False, True, True], [False, False, False]]


def test_the_button_counts_only_while_the_lever_is_thrown(cell):
    places = ((-0.3, 0.008), (0.9, 0.0), (0.9, 0.008))
    scenes = [{"lock": {"lever": lever}, "button": {"cap": cap}} for lever, cap in places]
    assert told(cell("Unlock"), "success", scenes) == [[False], [False], [True]]


def test_a_press_starts_when_both_buttons_are_pressed_and_the_loader_is_clear(cell):
    env = cell("TwoHandPress")
    scenes = [
        {"die": where, "block": where, "control": {"left": left, "right": right}}
        for where in ((0.0, 0.0, 0.025), tuple(env.state.tcp_position("loader")[0].tolist()))
        for left, right in ((0.006, 0.0), (0.0, 0.006), (0.006, 0.006))
    ]
    assert sum(told(env, "success", scenes), []) == [False, False, True, False, False, False]


def test_latches_count_over_a_lid_that_is_shut(cell):
    places = ((1.7, 0.0), (0.0, 0.044), (0.0, 0.0))
    scenes = [{"case": {"lid": lid, "left": 0.0, "right": right}} for lid, right in places]
    assert told(cell("ShutSuitcase"), "success", scenes) == [[False], [False], [True]]


def test_a_block_is_passed_on_by_corner_and_end_into_the_box(cell):
    env = cell("Relay")
    scenes = [{"block": place(env, where, 0.025)} for where in ("corner", "end", "box")]
    assert told(env, "is_at_corner is_at_end success", scenes) == np.eye(3, dtype=bool).tolist()


def test_cubes_go_round_on_the_turntable_and_belong_in_the_box_of_their_colour(cell):
    env = cell("UnloadTurntable")
    ahead, start = np.sign(-env.state.joint("turntable", "plate").item()), angles(env)
    for _ in range(20):  # a second
        env.step(np.zeros(env.action_space.shape))
    turned = ahead * (angles(env) - start) % (2 * np.pi)
    assert turned == pytest.approx(np.full(3, turned[0]), abs=0.01)
    assert 0.14 < turned[0] < 0.23
    own = {f"cube_{arm}": place(env, f"box_{arm}", 0.03) for arm in env.layout.arms}
    swapped = own | {"cube_red": own["cube_blue"], "cube_blue": own["cube_red"]}
    found = told(env, "are_two_in success", [swapped, own])
    assert found == [[False, False], [True, True]]


def angles(env: tasks.TaskEnv) -> np.ndarray:
    """Return where the cubes are round the middle of the turntable (rad)."""
    places = [place(env, f"cube_{arm}") for arm in env.layout.arms]
    return np.array([np.arctan2(y, x) for x, y, _ in places])


def test_the_bar_counts_behind_a_gate_that_is_shut_again(cell):
    env = cell("HoldGate")
    x, y, z = place(env, "mark", 0.02)
    scenes = [
        {"bar": (x, y + off, z), "gate": {"leaf": leaf}}
        for off, leaf in ((0.0, 1.4), (0.0, 0.05), (0.08, 0.05))
    ]
    found = told(env, "is_open is_through success", scenes)
    assert found == [[True, True, False], [False, True, True], [False, True, False]]


def test_brackets_count_once_they_hang_on_the_pegs_in_their_order(cell):
    env = cell("HangBrackets")
    x, y, z, *turned = env.state.pose("pegs")[0].tolist()
    w, *_, s = turned
    seats = [(x, y, z + 0.012 + 0.008 * i, *turned) for i in range(3)]
    back = (*seats[1][:3], -s, 0.0, 0.0, w)  # half a turn on
    scenes = [
        {"red": seats[1], "blue": seats[0], "bar": seats[2]},
        {"red": seats[0], "blue": back},
        {"bar": seats[2]},
    ]
    found = told(env, "are_two_on success", scenes)
    assert [found[0][0], found[1][0], found[2][1]] == [False, True, True]


def test_parts_belong_in_the_pockets_of_their_colours(cell):
    env = cell("PackKit")
    pockets = [place(env, f"pocket_{arm}") for arm in env.layout.arms]
    block, rod, stair, cross = ((x, y, z + 0.032) for x, y, z in pockets)
    scenes = [
        {"block": rod, "rod": block, "stair": stair, "cross": cross},
        {"block": block, "rod": rod},
    ]
    found = told(env, "are_two_in are_three_in success", scenes)
    assert found == [[True, False, False], [True, True, True]]


def test_pegs_are_home_once_the_mallet_stands_on_its_mark_again(cell):
    env = cell("HammerPegs")
    x, y, _ = place(env, "mark")
    home = {f"block_{arm}": {"peg": 0.026} for arm in env.layout.arms}
    scenes = [
        home | {"block_third": {"peg": third}, "mallet": mallet}
        for third, mallet in (
            (0.02, (x, y, 0.0)),
            (0.026, (x + 0.07, y, 0.0)),
            (0.026, (x, y, 0.03)),
            (0.026, (x, y, 0.0)),
        )
    ]
    assert told(env, "success", scenes) == [[False], [False], [False], [True]]


def test_cubes_count_in_a_bin_while_it_is_held_up(cell):
    env = cell("FillHeldBin")
    solve(env, "FillHeldBin")
    x, y, z, *turned = env.state.pose("bin")[0].tolist()
    scenes = [
        {
            "bin": (x, y, height, *turned),
            "cube_left": (x + beside, y, height + 0.03),
            "cube_right": (x, y, height + 0.03),
        }
        for height, beside in ((z, 0.0), (z, 0.2), (0.05, 0.0))
    ]
    found = told(env, "is_one_in success", scenes)
    assert found == [[True, True], [True, False], [False, False]]


def test_a_box_is_filled_once_its_lid_is_shut_over_both_cubes(cell):
    env = cell("OpenBox")
    x, y, _ = place(env, "box")
    scenes = [
        {"box": {"lid": lid}, "cube_left": (x + beside, y, 0.03), "cube_right": (x, y, 0.07)}
        for lid, beside in ((1.2, 0.0), (0.0, 0.0), (0.0, 0.3))
    ]
    found = told(env, "is_open are_both_in success", scenes)
    assert found == [[True, True, False], [False, True, True], [False, False, False]]


def test_each_peg_counts_in_the_socket_of_its_own_side(cell):
    env = cell("InsertPegs")
    solve(env, "InsertPegs")
    left, right = (tuple(env.state.pose(f"peg_{arm}")[0].tolist()) for arm in ("left", "right"))
    above = (*left[:2], left[2] + 0.03, *left[3:])
    pairs = ((above, right), (right, left), (left, right))
    scenes = [{"peg_left": first, "peg_right": second} for first, second in pairs]
    found = told(env, "is_one_in success", scenes)
    assert found == [[True, False], [False, False], [True, True]]


def test_a_mug_counts_once_it_stands_on_the_trivet_on_its_mark(cell):
    env = cell("HandMugOn")
    x, y, _ = place(env, "mark")
    assert told(env, "is_handed_on", [{"mug": place(env, "spot", 0.0)}]) == [[True]]
    scenes = [{"mug": (x, y, 0.03)}]  # the trivet is far
    for off, up in ((0.0, 0.03), (0.05, 0.03), (0.0, 0.06)):
        scenes.append({"trivet": (x, y, 0.015), "mug": (x + off, y, up)})
    assert told(env, "success", scenes) == [[False], [True], [False], [False]]


def test_a_cup_is_served_with_both_balls_in_it(cell):
    env = cell("PassGlass")
    x, y, _ = place(env, "mark")
    balls = {"ball_one": (x - 0.0115, y, 0.016), "ball_two": (x + 0.0115, y, 0.016)}
    full = {"cup": (x, y, 0.0), **balls}
    lost = {**full, "ball_two": (x + 0.1, y, 0.011)}
    scenes = [{**cup, "bell": {"cap": cap}} for cup in (full, lost) for cap in (0.0, 0.008)]
    found = told(env, "is_served success", scenes)
    assert found == [[True, False], [True, True], [False, False], [False, False]]


def test_a_box_belongs_on_the_plinth_with_the_tips_away(cell):
    scenes = [
        {"plinth": (0.0, -0.25, 0.025), "box": (aside, -0.25, up)}
        for aside, up in ((0.0, 0.11), (0.0, 0.14), (0.1, 0.14), (0.1, 0.06))
    ]
    found = told(cell("SqueezeBox"), "is_plinth_under success", scenes)
    assert found == [[False, True], [True, False], [False, False], [False, False]]
