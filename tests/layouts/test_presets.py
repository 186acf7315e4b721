"""Presets: where each puts its robots, which way they face, and what it refuses."""

import dataclasses
import math
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layouts import around_table, face_to_face, grid, ring, side_by_side, single, yaw_quaternion
from layouts.distances import HAND_OVER, ROUND_CORNERS
from layouts.frames import EDGES, table_outlines
from layouts.presets import PRESETS
from robot_layouts.kinematics.quaternions import forward, multiplied, rotated, yaw_degrees
from robots import LayoutError, RobotRegistry, UnknownNameError

spacings = st.floats(min_value=1e-3, max_value=100.0)
counts = {
    "single": 1,
    "side_by_side": 3,
    "face_to_face": 2,
    "ring": 5,
    "around_table": 6,
    "grid": 5,
}


def some_of(names):
    return st.lists(st.sampled_from(names), min_size=1, max_size=9).map(
        lambda robots: {f"arm_{i}": robot for i, robot in enumerate(robots)}
    )


mixed = some_of(RobotRegistry.names())
# A hand at a table may begin inside it, which no distance avoids.
ARMS = [name for name in RobotRegistry.names() if RobotRegistry.load(name).reach > 0.3]
mixed_arms = some_of(ARMS)
PANDA = RobotRegistry.load("panda")
# Robots of any size, from a toy to a crane.
sized = st.lists(st.floats(0.1, 10.0), min_size=1, max_size=9).map(
    lambda sizes: {
        f"arm_{i}": dataclasses.replace(PANDA, name=f"robot_{i}", reach=reach)
        for i, reach in enumerate(sizes)
    }
)


def distance(layout, first, second):
    return math.dist(layout[first].base_position, layout[second].base_position)


def reaches(layout, *names):
    return [layout[name].robot.reach for name in names]


@given(spacings)
def test_face_to_face_robots_look_at_each_other(spacing):
    layout = face_to_face({"left": "panda", "right": "panda_stick"}, spacing=spacing)
    left, right = layout["left"], layout["right"]
    between = [b - a for a, b in zip(left.base_position, right.base_position, strict=True)]
    assert math.hypot(*between) == pytest.approx(spacing)
    towards_right = [x / spacing for x in between]
    assert forward(left.base_quaternion) == pytest.approx(towards_right, abs=1e-12)
    assert forward(right.base_quaternion) == pytest.approx([-x for x in towards_right], abs=1e-12)


def test_face_to_face_meets_at_the_origin_with_the_first_at_negative_y():
    layout = face_to_face({"left": "panda", "right": "panda"}, spacing=1.5)
    assert layout["left"].base_position == (0.0, -0.75, 0.0)
    assert layout["right"].base_position == (0.0, 0.75, 0.0)


@given(spacings, st.integers(min_value=1, max_value=6))
def test_side_by_side_is_a_centred_row_facing_x(spacing, count):
    layout = side_by_side({f"arm_{i}": "panda" for i in range(count)}, spacing=spacing)
    ys = [placement.base_position[1] for placement in layout.values()]
    assert sum(ys) == pytest.approx(0, abs=1e-9 * spacing * count)
    assert [b - a for a, b in zip(ys, ys[1:], strict=False)] == pytest.approx(
        [spacing] * (count - 1)
    )
    for placement in layout.values():
        assert forward(placement.base_quaternion) == (1.0, 0.0, 0.0)


def test_single_stands_at_the_robots_home():
    placement = single({"arm": "panda_wristcam"})["arm"]
    assert placement.base_position == placement.robot.home.position
    assert placement.start_keyframe == "tabletop"


@pytest.mark.parametrize(
    ("preset", "names", "message"),
    [
        (single, ["a", "b"], r"single places 1 robot; 2 given: \['a', 'b'\]"),
        (single, [], "single places 1 robot; 0 given"),
        (face_to_face, ["a"], "face_to_face places 2 robots; 1 given"),
        (face_to_face, ["a", "b", "c"], "face_to_face places 2 robots; 3 given"),
        (side_by_side, [], "at least one robot"),
    ],
)
def test_a_wrong_number_of_robots(preset, names, message):
    options = {} if preset is single else {"spacing": 1.0}
    with pytest.raises(LayoutError, match=message):
        preset({name: "panda" for name in names}, **options)


@pytest.mark.parametrize("preset", PRESETS)
class TestEveryPreset:
    def options(self, preset):
        return {"spacing": 1.0} if preset in ("side_by_side", "face_to_face") else {}

    def test_a_robot_with_another_front_faces_as_a_panda_would(self, preset):
        names = [f"arm_{i}" for i in range(counts[preset])]
        pandas, others = (
            PRESETS[preset](dict.fromkeys(names, robot), **self.options(preset))
            for robot in ("panda", "so100")
        )
        for name in names:
            ahead = forward(others[name].facing)
            assert ahead == pytest.approx(forward(pandas[name].facing), abs=1e-12)


def test_native_poses_are_exact_to_the_last_bit():
    layout = face_to_face({"left": "panda_wristcam", "right": "panda_wristcam"}, spacing=1.5)
    for name, sign in (("left", 1), ("right", -1)):
        half = sign * math.pi / 4
        assert layout[name].base_quaternion == (math.cos(half), 0.0, 0.0, math.sin(half))
        assert str(layout[name].base_position[0]) == "0.0"


def apart(layout, *pair):
    """How far apart two robots stand if nothing else matters (m)."""
    smaller, larger = sorted(reaches(layout, *pair))
    return larger if smaller < larger / 2 else max(HAND_OVER * (smaller + larger), larger)


class TestAutomaticDistances:
    @pytest.fixture(autouse=True, scope="class")
    @classmethod
    def by_reach_alone(cls):
        """Pandas stand for robots of any size here, so that their bodies tell nothing."""
        with pytest.MonkeyPatch.context() as patch:
            patch.setitem(sys.modules, "fcl", None)
            yield

    @given(sized)
    def test_in_a_row_every_pair_of_neighbours_can_hand_over(self, robots):
        layout = side_by_side(robots, spacing="auto")
        names = list(layout)
        for pair in zip(names, names[1:], strict=False):
            length = distance(layout, *pair)
            assert length == pytest.approx(apart(layout, *pair))
            assert length < sum(reaches(layout, *pair)), "workspaces overlap"
            assert length >= max(reaches(layout, *pair)) - 1e-9, "bases are out of reach"
        ys = [placement.base_position[1] for placement in layout.values()]
        assert ys[0] == pytest.approx(-ys[-1])

    @given(sized.filter(lambda robots: len(robots) > 1))
    def test_in_a_ring_every_pair_of_neighbours_can_hand_over(self, robots):
        layout = ring(robots, radius="auto")
        names = list(layout)
        for pair in zip(names, [*names[1:], names[0]], strict=True):
            assert distance(layout, *pair) == pytest.approx(apart(layout, *pair), abs=1e-6)
        radii = [math.hypot(*placement.base_position) for placement in layout.values()]
        assert max(radii) == pytest.approx(min(radii))
        for placement in layout.values():
            inwards = [-x / radii[0] for x in placement.base_position]
            assert forward(placement.facing) == pytest.approx(inwards, abs=1e-9)

    @given(sized)
    def test_across_a_table_every_pair_can_hand_over(self, robots):
        names = list(robots)[:4]
        layout = around_table({name: robots[name] for name in names})
        share = HAND_OVER if len(names) < 3 else ROUND_CORNERS
        for pair in (names[:2], names[2:]):
            if len(pair) == 2:
                length = share * sum(reaches(layout, *pair))
                assert distance(layout, *pair) == pytest.approx(length)

    def test_two_pandas_stand_as_far_apart_as_in_native_to_within_a_centimetre(self):
        layout = face_to_face({"a": "panda", "b": "panda"}, spacing="auto")
        assert distance(layout, "a", "b") == pytest.approx(1.5, abs=0.01)

    @given(mixed)
    def test_one_robot_at_a_table_or_in_a_ring_reaches_the_middle(self, robots):
        name, robot = next(iter(robots.items()))
        for layout in (ring({name: robot}), around_table({name: robot})):
            assert math.hypot(*layout[name].base_position) == pytest.approx(
                HAND_OVER * layout[name].robot.reach
            )

    @pytest.mark.parametrize("preset", [side_by_side, face_to_face, grid, ring])
    def test_another_word_is_refused(self, preset):
        word = {"radius" if preset is ring else "spacing": "automatic"}
        with pytest.raises(LayoutError, match="is 'automatic'; it takes a number .* or 'auto'"):
            preset({"a": "panda", "b": "panda"}, **word)


class TestRing:
    @given(mixed, spacings, st.sampled_from(["centre", "out", "tangent"]))
    def test_turned_by_one_place_it_is_itself(self, robots, radius, facing):
        layout = ring(robots, radius=radius, facing=facing)
        turn = yaw_quaternion(2 * math.pi / len(layout))
        placements = list(layout.values())
        for one, following in zip(placements, [*placements[1:], placements[0]], strict=True):
            turned = rotated(turn, one.base_position)
            assert turned == pytest.approx(following.base_position, abs=1e-9 * (1 + radius))
            ahead = forward(multiplied(turn, one.facing))
            assert ahead == pytest.approx(forward(following.facing), abs=1e-9)

    def test_tangent_is_counterclockwise_towards_the_next(self):
        layout = ring({f"arm_{i}": "panda" for i in range(4)}, radius=1.0, facing="tangent")
        assert [yaw_degrees(p.facing) for p in layout.values()] == pytest.approx(
            [0, 90, 180, -90]
        ) or yaw_degrees(layout["arm_2"].facing) == pytest.approx(-180)
        assert layout["arm_1"].base_position == (1.0, 0.0, 0.0)

    def test_an_unknown_way_to_face(self):
        with pytest.raises(UnknownNameError, match="'center'. Did you mean 'centre'"):
            ring({"a": "panda"}, facing="center")


class TestAroundTable:
    def test_four_stand_at_the_middles_of_the_edges_and_look_across(self):
        robots = {f"arm_{i}": "panda" for i in range(4)}
        layout = around_table(robots, table=(1.2, 0.8), inset=0.1)
        expected = [(0, -0.3), (0, 0.3), (-0.5, 0), (0.5, 0)]
        for placement, (x, y) in zip(layout.values(), expected, strict=True):
            assert placement.base_position == pytest.approx((x, y, 0), abs=1e-12)
            length = math.hypot(x, y)
            towards = (-x / length, -y / length, 0)
            assert forward(placement.facing) == pytest.approx(towards, abs=1e-12)

    @settings(max_examples=6)  # each looks for collisions
    @given(mixed_arms, st.randoms(use_true_random=False))
    def test_everyone_stands_on_the_table_near_its_own_edge(self, robots, random):
        edges = {name: random.choice(list(EDGES)) for name in robots}
        layout = around_table(robots, edges=edges, inset=0.1)
        corners = next(iter(table_outlines(layout.frame_poses).values()))
        width, depth = (2 * max(corner[i] for corner in corners) for i in (0, 1))
        sides = {
            "north": lambda x, y: depth / 2 - y,
            "east": lambda x, y: width / 2 - x,
            "south": lambda x, y: depth / 2 + y,
            "west": lambda x, y: width / 2 + x,
        }
        for name, placement in layout.items():
            x, y, _ = placement.base_position
            assert sides[edges[name]](x, y) == pytest.approx(0.1)
            assert all(margin(x, y) >= 0.1 - 1e-9 for margin in sides.values())

    def test_robots_on_one_edge_share_it_from_right_to_left(self):
        robots = {"a": "panda", "b": "panda", "c": "panda"}
        layout = around_table(robots, edges=["south", "south", "south"], table=(3.0, 1.0))
        assert [p.base_position[0] for p in layout.values()] == pytest.approx([1.0, 0.0, -1.0])

    def test_neighbours_on_one_edge_of_an_automatic_table_can_hand_over(self):
        robots = {"a": "panda", "b": "so100", "c": "so100"}
        layout = around_table(robots, edges=["west", "west", "west"], inset=0.1)
        assert distance(layout, "a", "b") == pytest.approx(HAND_OVER * (0.855 + 0.44))
        assert distance(layout, "b", "c") == pytest.approx(HAND_OVER * 2 * 0.44)

    def test_edges_by_name_may_come_in_any_order(self):
        robots = {"a": "panda", "b": "panda"}
        layout = around_table(robots, edges={"b": "north", "a": "east"})
        assert [placement.on for placement in layout.values()] == ["table.east", "table.north"]

    @pytest.mark.parametrize(
        ("options", "error", "message"),
        [
            ({"edges": ["north", "sout"]}, UnknownNameError, "table edge 'sout'. .*'south'"),
            ({"edges": ["north"]}, LayoutError, r"takes one edge for each of \['a', 'b'\]"),
            ({"edges": "ns"}, LayoutError, "edges is 'ns'; it takes one edge for each"),
            ({"edges": {"a": "north"}}, LayoutError, "edges gives no edge for 'b'"),
            ({"edges": {"a": "north", "c": "north"}}, UnknownNameError, "robot at the table 'c'"),
            ({"table": "large"}, LayoutError, "table is 'large'; it takes width and depth"),
            ({"table": (1.0,)}, LayoutError, "it takes width and depth"),
            ({"table": (1.0, math.nan)}, LayoutError, "the table's depth is nan m; it must"),
            ({"table": (1.0, 0.2)}, LayoutError, "with an inset of 0.1 m it must be more than 0.2"),
            ({"inset": -0.1}, LayoutError, "inset is -0.1 m; it must be finite and greater than 0"),
            ({"inset": "far"}, LayoutError, "inset is 'far'; it takes a number"),
        ],
    )
    def test_refusals(self, options, error, message):
        with pytest.raises(error, match=message):
            around_table({"a": "panda", "b": "panda"}, **options)


class TestGrid:
    @given(mixed, st.integers(1, 10), spacings)
    def test_neighbours_are_one_spacing_apart_in_rows_along_y(self, robots, columns, spacing):
        layout = grid(robots, columns=columns, spacing=spacing)
        places = [placement.base_position for placement in layout.values()]
        per_row = min(columns, len(places))
        for i, (x, y, _) in enumerate(places):
            row, column = divmod(i, per_row)
            assert x - places[0][0] == pytest.approx(row * spacing)
            assert y - places[0][1] == pytest.approx(column * spacing)
        assert places[0][1] == pytest.approx(-(per_row - 1) / 2 * spacing)

    @pytest.mark.parametrize("columns", [0, -1, 1.5, "2", True])
    def test_columns_that_are_no_count(self, columns):
        with pytest.raises(LayoutError, match="columns is .*; it must be an integer of 1 or more"):
            grid({"a": "panda"}, columns=columns)

    def test_left_out_columns_make_it_square(self):
        layout = grid({f"arm_{i}": "panda" for i in range(9)}, spacing=1.0)
        places = {placement.base_position[:2] for placement in layout.values()}
        assert places == {(x, y) for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0)}


DISTANCES = [(side_by_side, "spacing"), (face_to_face, "spacing"), (ring, "radius")]
DISTANCES += [(grid, "spacing"), (around_table, "inset")]


@pytest.mark.parametrize(("preset", "name"), DISTANCES)
def test_a_distance_that_is_none(preset, name):
    message = f"{name} is .* m; it must be finite and greater than 0"
    for value in (None, True, (1,), 1j, 0, -1, math.nan, math.inf, 1e7, 1e308, 10**400):
        with pytest.raises(LayoutError, match=message):
            preset({"a": "panda", "b": "panda"}, **{name: value})


@pytest.mark.parametrize("preset", PRESETS)
def test_robots_that_are_no_mapping(preset):
    spacing = {"spacing": 1.5} if preset in ("side_by_side", "face_to_face") else {}
    for robots in (None, ["panda", "panda"], "panda", 2):
        with pytest.raises(LayoutError, match="robots is .*; it takes a mapping .*'left': 'panda'"):
            PRESETS[preset](robots, **spacing)
