"""A layout: order, action slices, equality, and what it refuses."""

import copy
import math
import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layouts import Layout, Placement, face_to_face, side_by_side
from robots import LayoutError, RobotRegistry, UnknownNameError

PANDAS = {"left": "panda_wristcam", "right": "panda_wristcam"}

named_robots = st.dictionaries(
    st.sampled_from([f"arm_{i}" for i in range(8)]),
    st.sampled_from(RobotRegistry.names()),
    min_size=1,
    max_size=8,
)


def in_a_row(robots):
    return side_by_side(robots, spacing=1.0)


class TestActionSplit:
    def test_two_pandas_take_eight_numbers_each(self):
        layout = face_to_face(PANDAS, spacing=1.5)
        assert layout.action_split == {"left": slice(0, 8), "right": slice(8, 16)}
        assert layout.action_dim == 16

    def test_order_is_declared_not_sorted(self):
        layout = in_a_row({"b": "panda_stick", "a": "panda"})
        assert list(layout.action_split.items()) == [("b", slice(0, 7)), ("a", slice(7, 15))]

    def test_changing_the_returned_split_does_not_change_the_layout(self):
        layout = face_to_face(PANDAS, spacing=1.5)
        layout.action_split.clear()
        assert list(layout.action_split) == ["left", "right"]

    @given(named_robots)
    def test_slices_partition_the_flat_action(self, robots):
        layout = in_a_row(robots)
        numbers = list(range(layout.action_dim))
        for split in (layout.action_split, layout.robot_actions):
            parts = [numbers[part] for part in split.values()]
            assert [number for part in parts for number in part] == numbers

    @given(named_robots, st.randoms(use_true_random=False))
    def test_permuting_robots_permutes_slices_and_nothing_else(self, robots, random):
        layout = in_a_row(robots)
        names = list(layout)
        random.shuffle(names)
        permuted = Layout({name: layout[name] for name in names})
        assert list(permuted.robot_actions) == names
        assert list(dict.fromkeys(map(permuted.owner, permuted.action_split))) == names
        assert dict(permuted) == dict(layout)
        flat = {
            name: [f"{name}/{number}" for number in range(placement.robot.action_dim)]
            for name, placement in layout.items()
        }
        joined = [number for name in names for number in flat[name]]
        assert {name: joined[part] for name, part in permuted.robot_actions.items()} == flat


class TestReplaceRobots:
    def test_only_the_named_place_changes(self):
        layout = face_to_face(PANDAS, spacing=1.5)
        replaced = layout.replace_robots(right="panda_stick")
        assert replaced["left"] == layout["left"]
        assert replaced["right"].robot is RobotRegistry.load("panda_stick")
        assert replaced["right"].base_position == layout["right"].base_position
        assert replaced.action_split == {"left": slice(0, 8), "right": slice(8, 15)}
        assert layout["right"].robot.name == "panda_wristcam"

    def test_unknown_place_names_the_places(self):
        layout = face_to_face(PANDAS, spacing=1.5)
        with pytest.raises(UnknownNameError, match="'rigt'.*'right'.*left, right"):
            layout.replace_robots(rigt="panda")

    def test_a_keyframe_the_new_robot_lacks_is_refused(self):
        layout = face_to_face(PANDAS, spacing=1.5, keyframe="tabletop")
        with pytest.raises(UnknownNameError, match="keyframe of panda_stick 'tabletop'"):
            layout.replace_robots(right="panda_stick")


class TestIdentity:
    def test_equal_when_names_order_and_placements_are(self):
        one, other = (face_to_face(PANDAS, spacing=1.5) for _ in range(2))
        assert one == other
        assert hash(one) == hash(other)

    @pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy])
    def test_copies_are_equal(self, duplicate):
        layout = face_to_face(PANDAS, spacing=1.5)
        assert duplicate(layout) == layout

    @pytest.mark.parametrize("protocol", range(2, pickle.HIGHEST_PROTOCOL + 1))
    def test_pickle_gives_an_equal_layout(self, protocol):
        layout = face_to_face(PANDAS, spacing=1.5)
        again = pickle.loads(pickle.dumps(layout, protocol))
        assert again == layout
        assert hash(again) == hash(layout)
        assert list(again) == list(layout)

    def test_frozen(self):
        layout = face_to_face(PANDAS, spacing=1.5)
        with pytest.raises(AttributeError, match="frozen"):
            layout.spacing = 2.0
        with pytest.raises(TypeError):
            layout["left"] = layout["right"]


class TestRefusals:
    def test_no_robot(self):
        with pytest.raises(LayoutError, match="at least one robot"):
            Layout({})

    def test_a_name_given_twice(self):
        arm = Placement("panda")
        with pytest.raises(LayoutError, match=r"\['arm'\] are given twice"):
            Layout.of(("arm", arm), ("other", arm), ("arm", arm))

    @pytest.mark.parametrize("name", ["", "left arm", "left-arm", "1st", 7])
    def test_a_name_that_is_no_identifier(self, name):
        with pytest.raises(LayoutError, match="must be a letter followed by"):
            Layout({name: Placement("panda")})

    def test_a_robot_without_a_placement(self):
        with pytest.raises(LayoutError, match="'arm' is a str; a layout holds Placements"):
            Layout({"arm": "panda"})

    def test_an_unknown_name_is_a_key_error_with_the_choices(self):
        layout = face_to_face(PANDAS, spacing=1.5)
        with pytest.raises(KeyError, match="'lft'.*Did you mean 'left'.*left, right"):
            layout["lft"]

    @pytest.mark.parametrize("quaternion", [(0, 0, 0, 0), (1, 1, 0, 0), (1.01, 0, 0, 0)])
    def test_a_quaternion_that_is_no_rotation_tells_its_length(self, quaternion):
        length = math.sqrt(sum(x * x for x in quaternion))
        with pytest.raises(LayoutError, match=f"length {length:.6g}; a rotation has length 1"):
            Placement("panda", quaternion=quaternion)

    def test_a_quaternion_in_single_precision_is_accepted(self):
        Placement("panda", quaternion=(0.70710677, 0.0, 0.0, 0.70710677))

    @pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
    def test_a_pose_that_is_not_finite(self, bad):
        with pytest.raises(LayoutError, match="position is .* it takes 3 finite numbers"):
            Placement("panda", position=(0, bad, 0))
        with pytest.raises(LayoutError, match="quaternion is .* it takes 4 finite numbers"):
            Placement("panda", quaternion=(1, bad, 0, 0))

    @pytest.mark.parametrize("position", [(), (0, 0), (0, 0, 0, 0)])
    def test_a_position_of_the_wrong_length(self, position):
        with pytest.raises(LayoutError, match="position is .* it takes 3 finite numbers"):
            Placement("panda", position=position)

    @pytest.mark.parametrize("position", [1.0, "here", ("a", "b", "c"), [None] * 3])
    def test_a_position_that_is_no_numbers(self, position):
        with pytest.raises(LayoutError, match="position is .* it takes 3 numbers"):
            Placement("panda", position=position)

    @pytest.mark.parametrize("noise", [-0.1, math.nan, math.inf])
    def test_joint_noise_that_is_no_deviation(self, noise):
        with pytest.raises(LayoutError, match="qpos_noise is .* rad; it must be 0 or more"):
            Placement("panda", qpos_noise=noise)


class TestText:
    def test_a_table_with_one_line_per_robot(self):
        text = str(face_to_face({"left": "panda_wristcam", "right": "panda_stick"}, spacing=1.5))
        headline, columns, left, right = text.splitlines()
        assert headline == "2 robots, 15 action numbers"
        assert columns.split()[:4] == ["#", "name", "robot", "action"]
        assert left.split() == "1 left panda_wristcam 0:8 0, -0.75, 0 90° rest 0.855".split()
        assert right.split() == "2 right panda_stick 8:15 0, 0.75, 0 -90° rest 0.855".split()

    def test_facing_is_where_the_robot_reaches_whatever_its_bases_x_axis(self):
        for robot in RobotRegistry.names():
            row = str(side_by_side({"arm": robot}, spacing=1.0, keyframe=None)).splitlines()[2]
            assert row.split()[7] == "0°"
            assert RobotRegistry.load(robot).limbs or row.split()[4:7] == ["0,", "0,", "0"]

    def test_a_tilted_base_shows_its_quaternion(self):
        layout = Layout({"arm": Placement("panda", quaternion=(0.6, 0.8, 0.0, 0.0))})
        assert "wxyz 0.6, 0.8, 0, 0" in str(layout)

    def test_repr_is_short(self):
        layout = face_to_face(PANDAS, spacing=1.5)
        assert repr(layout) == "Layout(left=panda_wristcam, right=panda_wristcam)"
