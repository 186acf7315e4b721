"""Frames to hang on: where they put robots, what follows what, and what is refused."""

import dataclasses
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layouts import (
    Frame,
    Layout,
    Placement,
    Pose,
    around_table,
    ceiling,
    rpy_quaternion,
    table,
    wall,
    yaw_quaternion,
)
from layouts.frames import EDGES, table_outlines
from robot_layouts.kinematics.quaternions import forward, multiplied, rotated, upward
from robots import LayoutError

numbers = st.floats(-10, 10)
vectors = st.tuples(numbers, numbers, numbers)
angles = st.floats(-math.pi, math.pi)


def same_turn(one, other):
    """Whether two quaternions (wxyz) are one rotation, up to rounding."""
    return abs(sum(a * b for a, b in zip(one, other, strict=True))) == pytest.approx(1, abs=1e-12)


class TestWhereThingsAre:
    def test_in_the_world_a_placement_is_where_it_says_to_the_last_bit(self):
        position, quaternion = (0.1, 0.2, 0.3), (0.70710677, 0.0, 0.0, 0.70710677)
        layout = Layout({"arm": Placement("panda", position, quaternion)})
        assert layout["arm"].base_position == position
        assert layout["arm"].base_quaternion == quaternion

    def test_rpy_is_another_way_to_say_quaternion(self):
        rpy = (0.1, -0.2, 0.3)
        assert Placement("panda", rpy=rpy).base_quaternion == rpy_quaternion(rpy)
        assert Placement("panda", rpy=rpy).rpy == rpy

    @given(vectors, vectors, angles, angles)
    def test_a_chain_is_the_product_of_its_poses(self, near, far, yaw, roll):
        layout = Layout(
            {
                "first": Placement("panda", near, on="frame", rpy=(roll, 0.0, 0.0)),
                "second": Placement("so100", near, (1, 0, 0, 0), on="first"),
            },
            {"frame": Frame(far, rpy=(0.0, 0.0, yaw))},
        )
        outer, inner = yaw_quaternion(yaw), rpy_quaternion((roll, 0.0, 0.0))
        first = [a + b for a, b in zip(far, rotated(outer, near), strict=True)]
        assert layout["first"].base_position == pytest.approx(first, abs=1e-9)
        turn = multiplied(outer, inner)
        assert same_turn(layout["first"].base_quaternion, turn)
        second = [a + b for a, b in zip(first, rotated(turn, near), strict=True)]
        assert layout["second"].base_position == pytest.approx(second, abs=1e-9)
        assert same_turn(layout["second"].base_quaternion, turn)

    def test_what_is_left_out_is_the_frames_origin_and_the_robots_own_turn(self):
        layout = Layout({"arm": Placement("so100", on="here")}, {"here": Frame((1.0, 2.0, 3.0))})
        assert layout["arm"].base_position == (1.0, 2.0, 3.0)
        assert same_turn(layout["arm"].base_quaternion, layout["arm"].robot.home.quaternion)
        assert same_turn(layout["arm"].facing, (1, 0, 0, 0))

    def test_upside_down_under_a_ceiling(self):
        layout = Layout({"arm": Placement("panda", on="roof")}, {"roof": ceiling(2.0)})
        assert layout["arm"].base_position == (0.0, 0.0, 2.0)
        assert upward(layout["arm"].base_quaternion) == pytest.approx((0, 0, -1))
        assert forward(layout["arm"].base_quaternion) == pytest.approx((1, 0, 0))

    @given(angles)
    def test_on_a_wall_a_robot_stands_out_from_it_and_its_front_is_down(self, yaw):
        layout = Layout(
            {"arm": Placement("panda", (0.0, 0.0, 0.1), on="wall")},
            {"wall": wall((1.0, 0.0, 0.5), yaw=yaw)},
        )
        out = (math.cos(yaw), math.sin(yaw), 0.0)
        assert upward(layout["arm"].base_quaternion) == pytest.approx(out, abs=1e-12)
        assert forward(layout["arm"].base_quaternion) == pytest.approx((0, 0, -1), abs=1e-12)
        expected = (1.0 + 0.1 * out[0], 0.1 * out[1], 0.5)
        assert layout["arm"].base_position == pytest.approx(expected)

    @given(angles, st.sampled_from(list(EDGES)))
    def test_at_a_tables_edge_a_robot_faces_its_middle(self, yaw, edge):
        frames = table(1.2, 0.8, position=(0.5, 0.0, 0.7), yaw=yaw, name="bench")
        layout = Layout({"arm": Placement("so100", on=f"bench.{edge}")}, frames)
        x, y, z = layout["arm"].base_position
        size = 1.2 if edge in ("east", "west") else 0.8
        assert math.hypot(x - 0.5, y) == pytest.approx(size / 2)
        assert z == 0.7
        inwards = ((0.5 - x) / (size / 2), -y / (size / 2), 0.0)
        assert forward(layout["arm"].facing) == pytest.approx(inwards, abs=1e-9)

    def test_a_tables_outline(self):
        layout = Layout({"arm": Placement("panda")}, table(2.0, 1.0, position=(0.0, 0.5, 0.0)))
        outline = table_outlines(layout.frame_poses)["table"]
        corners = {(round(x, 9), round(y, 9)) for x, y, _ in outline}
        assert corners == {(1.0, 1.0), (1.0, 0.0), (-1.0, 0.0), (-1.0, 1.0)}

    def test_the_order_of_declaration_does_not_matter(self):
        placements = {
            "last": Placement("panda", (0.0, 0.0, 1.0), on="middle"),
            "middle": Placement("panda", (0.0, 1.0, 0.0), on="b"),
        }
        frames = {"b": Frame((1.0, 0.0, 0.0), on="a"), "a": Frame((1.0, 0.0, 0.0))}
        layout = Layout(placements, frames)
        assert layout["last"].base_position == (2.0, 1.0, 1.0)
        assert layout == Layout(placements, dict(reversed(frames.items())))
        assert layout.frame_poses["b"] == Pose((2.0, 0.0, 0.0))


class TestChangedLayouts:
    LAYOUT = around_table({"a": "panda", "b": "panda_stick"})

    def test_another_robot_hangs_in_the_same_place_and_faces_the_same_way(self):
        replaced = self.LAYOUT.replace_robots(b="so100")
        assert replaced["b"].base_position == self.LAYOUT["b"].base_position
        assert same_turn(replaced["b"].facing, self.LAYOUT["b"].facing)
        assert replaced.frames == self.LAYOUT.frames

    def test_a_turn_given_for_one_robot_serves_another_front(self):
        for turn in ({"quaternion": yaw_quaternion(1.0)}, {"rpy": (0.0, 0.0, 1.0)}):
            panda = Placement("panda", **turn)
            arm = panda.with_robot("so100")
            assert same_turn(arm.facing, yaw_quaternion(1.0))
            assert same_turn(arm.with_robot("panda").base_quaternion, panda.base_quaternion)

    def test_frames_count_in_comparisons(self):
        one, other = (
            Layout({"arm": Placement("panda", on="roof")}, {"roof": ceiling(height)})
            for height in (1.0, 2.0)
        )
        assert one != other

    def test_a_changed_placement_forgets_where_it_was(self):
        changed = dataclasses.replace(self.LAYOUT["a"], on="table.west")
        with pytest.raises(LayoutError, match="hangs on 'table.west'; only a layout that holds"):
            _ = changed.base_position
        moved = Layout({**self.LAYOUT, "a": changed}, self.LAYOUT.frames)
        assert moved["a"].base_position[0] < -0.5

    @given(vectors, angles)
    def test_moved_is_a_rigid_move_that_keeps_who_hangs_on_what(self, shift, yaw):
        layout = Layout(
            {
                "a": Placement("panda"),
                "b": Placement("so100", (0.1, 0.2, 0.3), on="a"),
                "c": Placement("panda", rpy=(0.1, 0.2, 0.3), on="roof"),
            },
            {"roof": ceiling(2.0)},
        )
        moved = layout.moved(shift, yaw)
        move = Pose(shift, yaw_quaternion(yaw))
        for name, placement in layout.items():
            expected = move.then(placement.base_pose)
            assert moved[name].base_position == pytest.approx(expected.position, abs=1e-9)
            assert same_turn(moved[name].base_quaternion, expected.quaternion)
            assert moved[name].on == placement.on
        assert moved["b"] == layout["b"]
        assert moved.action_split == layout.action_split

    @pytest.mark.parametrize(("shift", "yaw"), [((0, 0, math.nan), 0), ((0, 0, 0), math.inf)])
    def test_a_move_that_is_not_finite(self, shift, yaw):
        with pytest.raises(LayoutError, match="3 finite numbers|a number from -1e.06 to 1e.06 rad"):
            self.LAYOUT.moved(shift, yaw)


class TestRefusals:
    @pytest.mark.parametrize(
        ("hangs", "circle"),
        [
            ({"a": "a"}, "'a' on 'a'"),
            ({"a": "b", "b": "a"}, "'a' on 'b' on 'a'"),
            ({"x": "a", "a": "b", "b": "c", "c": "a"}, "'a' on 'b' on 'c' on 'a'"),
        ],
    )
    def test_a_circle_is_named(self, hangs, circle):
        with pytest.raises(LayoutError, match=f"hang on each other: {circle};"):
            Layout({name: Placement("panda", on=on) for name, on in hangs.items()})

    def test_a_frame_that_is_none(self):
        with pytest.raises(LayoutError, match=r"'wall' is a tuple; it must be a layouts\.Frame"):
            Layout({"arm": Placement("panda")}, {"wall": (0, 0, 0)})  # type: ignore[dict-item]

    @pytest.mark.parametrize("declare", [Frame, lambda **pose: Placement("panda", **pose)])
    def test_poses_that_are_none(self, declare):
        with pytest.raises(LayoutError, match="are both given; give one of them"):
            declare(quaternion=(1, 0, 0, 0), rpy=(0, 0, 0))
        with pytest.raises(LayoutError, match="rpy is .* it takes 3 finite numbers"):
            declare(rpy=(0, math.nan, 0))
        with pytest.raises(LayoutError, match=r"length 1\.41421; a rotation has length 1"):
            declare(quaternion=(1, 1, 0, 0))
        with pytest.raises(LayoutError, match="on is 7; it takes the name of a frame or robot"):
            declare(on=7)

    @pytest.mark.parametrize("size", [0.0, -1.0, math.nan, math.inf])
    def test_a_table_without_a_size(self, size):
        with pytest.raises(LayoutError, match="a table's depth is .* m; it must be finite and"):
            table(1.0, size)


def test_the_table_of_text_says_what_a_robot_hangs_on():
    layout = Layout(
        {"a": Placement("panda", on="roof"), "b": Placement("panda")}, {"roof": ceiling(2.0)}
    )
    _, columns, first, second = str(layout).splitlines()
    assert columns.split()[-1] == "on"
    assert first.split()[-1] == "roof"
    assert second.split()[-1] == "–"
    assert "on" not in str(Layout({"b": Placement("panda")})).splitlines()[1].split()[-1:]
