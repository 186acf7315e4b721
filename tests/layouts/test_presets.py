"""Presets: where each puts its robots, which way they face, and what it refuses."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layouts import face_to_face, side_by_side, single, yaw_quaternion
from layouts.orientation import forward, upward, yaw_degrees
from layouts.presets import PRESETS
from robots import LayoutError, UnknownNameError

spacings = st.floats(min_value=1e-3, max_value=100.0)
counts = {"single": 1, "side_by_side": 3, "face_to_face": 2}


def build(preset, **options):
    robots = {f"arm_{i}": "panda" for i in range(counts[preset])}
    return PRESETS[preset](robots, **options)


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


def test_single_takes_another_keyframe():
    placement = single({"arm": "panda_wristcam"}, keyframe="rest")["arm"]
    assert placement.start_qpos == placement.robot.keyframe("rest")


@pytest.mark.parametrize("preset", ["side_by_side", "face_to_face"])
@pytest.mark.parametrize("spacing", [0, -1, math.nan, math.inf])
def test_a_spacing_that_is_no_distance(preset, spacing):
    with pytest.raises(LayoutError, match="spacing is .* m; it must be finite and greater than 0"):
        build(preset, spacing=spacing)


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
        return {} if preset == "single" else {"spacing": 1.0}

    def test_keeps_names_and_order(self, preset):
        layout = build(preset, **self.options(preset))
        assert list(layout) == [f"arm_{i}" for i in range(counts[preset])]

    def test_robots_stand_upright_on_the_ground(self, preset):
        for placement in build(preset, **self.options(preset)).values():
            assert placement.base_position[2] == 0.0
            assert upward(placement.base_quaternion) == (0.0, 0.0, 1.0)

    def test_unknown_robot(self, preset):
        robots = {f"arm_{i}": "pandaa" for i in range(counts[preset])}
        with pytest.raises(UnknownNameError, match="Did you mean 'panda'"):
            PRESETS[preset](robots, **self.options(preset))

    def test_unknown_keyframe(self, preset):
        with pytest.raises(UnknownNameError, match="keyframe of panda 'folded'"):
            build(preset, keyframe="folded", **self.options(preset))


@given(st.floats(min_value=-179.9, max_value=179.9))
def test_yaw_survives_the_quaternion(degrees):
    assert yaw_degrees(yaw_quaternion(math.radians(degrees))) == pytest.approx(degrees, abs=1e-9)


def test_a_tilted_frame_has_no_yaw():
    assert yaw_degrees((math.cos(0.1), math.sin(0.1), 0.0, 0.0)) is None
