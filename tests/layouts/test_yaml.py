"""Layouts as YAML: nothing is lost, nothing is executed, and an error names its line."""

import dataclasses
import math
import os
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from layouts import Frame, Layout, Placement, around_table, face_to_face, ring
from layouts.presets import PRESETS
from robots import LayoutError, RobotRegistry
from robots.registry import ROBOTS

floats = st.floats(-1e6, 1e6)
vectors = st.tuples(floats, floats, floats)
axes = st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: math.hypot(*q) > 0.01)
quaternions = axes.map(lambda q: tuple(x / math.hypot(*q) for x in q))
identifiers = st.one_of(
    st.sampled_from(["no", "on", "null", "true", "y", "None", "größe", "Ωμέγα", "version"]),
    st.from_regex(r"[^\W\d]\w{0,8}", fullmatch=True).filter(str.isidentifier),
)


@st.composite
def poses(draw, supports):
    """Draw what a frame or placement says about its pose."""
    pose = {}
    if supports and draw(st.booleans()):
        pose["on"] = draw(st.sampled_from(supports))
    if draw(st.booleans()):
        pose["position"] = draw(st.tuples(*[st.floats(-1e6, 1e6)] * 3))
    turn = draw(st.sampled_from([None, "quaternion", "rpy"]))
    if turn is not None:
        pose[turn] = draw(quaternions if turn == "quaternion" else vectors)
    return pose


@st.composite
def placements(draw, supports):
    robot = RobotRegistry.load(draw(st.sampled_from(RobotRegistry.names())))
    return Placement(
        robot,
        keyframe=draw(st.none() | st.sampled_from(sorted(robot.keyframes))),
        qpos_noise=draw(st.floats(0, 1)),
        **draw(poses(supports)),
    )


@st.composite
def layouts(draw):
    names = draw(st.lists(identifiers, min_size=1, max_size=6, unique=True))
    count = draw(st.integers(0, len(names) - 1))
    known = []  # each may hang on those before it
    frames, robots = {}, {}
    for i, name in enumerate(names):
        if i < count:
            frames[name] = Frame(**draw(poses(known)))
        else:
            robots[name] = draw(placements(known))
        known.append(name)
    order = draw(st.permutations(list(robots)))
    return Layout({name: robots[name] for name in order}, frames)


def with_bits(layout):
    """Everything a layout declares, with -0.0 told from 0.0."""
    return repr([*layout.items(), *layout.frames.items()])


class TestRoundTrip:
    @pytest.mark.long
    @given(layouts())
    @settings(max_examples=60)
    def test_nothing_is_lost_and_other_readers_see_the_same_numbers(self, layout):
        text = layout.to_yaml()
        again = Layout.from_yaml(text)
        assert again == layout
        assert with_bits(again) == with_bits(layout)
        assert again.to_yaml() == text
        read = yaml.safe_load(text)
        for name, placement in layout.items():
            entry = read["robots"][name]
            assert entry["robot"] == placement.robot.name
            assert tuple(entry.get("rpy", ())) == (placement.rpy or ())
            assert entry.get("qpos_noise", 0.02) == placement.qpos_noise

    @pytest.mark.parametrize("preset", PRESETS)
    def test_every_preset(self, preset):
        count = {"single": 1, "face_to_face": 2}.get(preset, 5)
        options = {"spacing": 1 / 3} if "face" in preset or "side" in preset else {}
        layout = PRESETS[preset]({f"arm_{i}": "so100" for i in range(count)}, **options)
        assert Layout.from_yaml(layout.to_yaml()) == layout

    def test_what_a_person_reads(self):
        layout = Layout(
            {
                "left": Placement("panda", keyframe="rest", on="wall"),
                "no": Placement("so100", (0.1, -2, 1e-7), qpos_noise=0),
                "right": Placement("panda"),
            },
            {"wall": Frame((0, 1, 0.5), rpy=(0, 0.5, 0))},
        )
        assert layout.to_yaml() == (
            "# positions in m; quaternion: w, x, y, z; rpy and qpos_noise in rad\n"
            "version: 1\n"
            "frames:\n"
            "  wall:\n"
            "    position: [0.0, 1.0, 0.5]\n"
            "    rpy: [0.0, 0.5, 0.0]\n"
            "robots:\n"
            "  left:\n"
            "    robot: panda\n"
            "    on: wall\n"
            "    keyframe: rest\n"
            '  "no":\n'
            "    robot: so100\n"
            "    position: [0.1, -2.0, 1.0e-07]\n"
            "    qpos_noise: 0.0\n"
            "  right:\n"
            "    robot: panda\n"
        )

    def test_what_a_person_writes(self):
        text = (
            "version: 1\n"
            "robots: {b: {robot: panda, position: [-1, .5, 1e-3]}, a: {robot: 'so100'}}\n"
            "frames: {}\n"
        )
        layout = Layout.from_yaml(text)
        assert layout == Layout(
            {"b": Placement("panda", (-1, 0.5, 0.001)), "a": Placement("so100")}
        )
        assert list(layout) == ["b", "a"]

    def test_odd_keyframe_names(self):
        name = 'a "b"\\\n\x7f\u2028🦾: #'
        panda = RobotRegistry.load("panda")
        odd = dataclasses.replace(
            panda, name="odd_panda", keyframes={**panda.keyframes, name: panda.keyframe("rest")}
        )
        RobotRegistry.register(odd)
        try:
            layout = Layout({"arm": Placement(odd, keyframe=name)})
            assert Layout.from_yaml(layout.to_yaml()) == layout
        finally:
            del ROBOTS.registered["odd_panda"]


class TestRobotsThatCannotBeWritten:
    def test_one_that_is_not_registered(self):
        mine = dataclasses.replace(RobotRegistry.load("panda"), name="mine")
        with pytest.raises(LayoutError, match=r"'mine' of 'arm' is not registered.*register\("):
            Layout({"arm": Placement(mine)}).to_yaml()

    def test_one_that_differs_from_the_registered(self):
        layout = face_to_face({"a": "panda", "b": "panda"}, spacing=1.5)
        with pytest.raises(LayoutError, match="robot of 'a' differs from the registered 'panda'"):
            layout.in_control_mode("pd_joint_pos").to_yaml()


HEAD = "version: 1\nrobots:\n  left:\n    robot: panda\n"


class TestErrors:
    @pytest.mark.parametrize(
        ("text", "message"),
        [
            ("", "^this is empty"),
            ("# only a comment\n", "^this is empty"),
            ("- left\n", "^line 1: a layout is a list; a mapping"),
            ("robots: {left: {robot: panda}}", "^line 1: a layout needs its schema version; add"),
            ("version: 2\nrobots: {}", "^line 1: version is '2'; this library reads version 1"),
            ("version: [1]\nrobots: {}", "^line 1: version is a list"),
            ("version: 1\n", "^line 1: a layout needs robots"),
            ("version: 1\nrobots: {}\n", "^line 2: a layout needs at least one robot"),
            ("version: 1\nrobots:\n", "^line 2: robots is empty; a mapping"),
            ("version: 1\nrobotz: {}\n", "^line 2: a layout has an unknown key 'robotz'. Did you"),
            ("version: 1\nrobots:\n  left: panda\n", "^line 3: robot 'left' is 'panda'; a mapping"),
            ("version: 1\nrobots:\n  left arm: {robot: panda}\n", "^line 3: robot name 'left arm'"),
            ("version: 1\nrobots:\n  left:\n    keyframe: rest\n", "^line 4: 'left' needs 'robot'"),
            (
                "version: 1\nrobots:\n  left:\n    robot: pandas\n",
                "^line 4: unknown robot 'pandas'",
            ),
            ("version: 1\nrobots:\n  left:\n    robot: 7\n", "^line 4: robot is 7; a name is"),
            ("version: 1\nrobots:\n  left:\n    robot: [panda]\n", "^line 4: robot is a list"),
            ("version: 1\nrobots:\n  left:\n    robot:\n", "^line 4: robot is empty; a name is"),
            (HEAD + "    positon: [0, 0, 0]\n", "^line 5: .*'positon'. Did you mean 'position'"),
            (HEAD + "    position: 0\n", "^line 5: position is '0'; a list of numbers is needed"),
            (HEAD + "    position: [0, 0]\n", "^line 5: position is .* 3 finite numbers"),
            (HEAD + "    position:\n    - 0\n    - .nan\n", "^line 7: position has .nan; a finite"),
            (HEAD + "    position: [0, -.inf, 0]\n", "^line 5: position has -.inf; a finite"),
            (HEAD + "    position: [0, 1e999, 0]\n", "^line 5: position has 1e999, which is too"),
            (HEAD + "    position: [0, '1', 0]\n", "^line 5: position has '1'; a number is needed"),
            (HEAD + "    position: [0, 010, 0]\n", "^line 5: position has '010'; a number"),
            (HEAD + "    position: [0, 1_0, 0]\n", "^line 5: position has '1_0'; a number"),
            (HEAD + "    position: [0, [0], 0]\n", "^line 5: position is a list; a single"),
            (HEAD + "    quaternion: [1, 1, 0, 0]\n", "^line 5: quaternion .* length 1.41421"),
            (HEAD + "    rpy: [0, 0, 0]\n    quaternion: [1, 0, 0, 0]\n", "^line 6: .* both given"),
            (HEAD + "    keyframe: ret\n", "^line 5: unknown keyframe of panda 'ret'. .*'rest'"),
            (HEAD + "    keyframe: null\n", "^line 5: keyframe is null; a name is needed"),
            (HEAD + "    qpos_noise: -1\n", "^line 5: qpos_noise is -1.0 rad; it must be 0"),
            (HEAD + "    qpos_noise: yes\n", "^line 5: qpos_noise has 'yes'; a number is needed"),
            (
                HEAD + "    robot: panda\n",
                "^line 5: 'robot' is given twice; the first is in line 4",
            ),
            (HEAD + "  left: {robot: panda}\n", "^line 5: 'left' is given twice; .* in line 3"),
            (HEAD + "version: 1\n", "^line 5: 'version' is given twice; the first is in line 1"),
            (HEAD + "    on: wal\nframes:\n  wall: {}\n", "^line 5: .*'wal'. Did you mean 'wall'"),
            (HEAD + "    on: left\n", "^line 5: these hang on each other: 'left' on 'left'"),
            (HEAD + "frames:\n  left: {}\n", "^line 3: 'left' names both a robot and a frame"),
            (HEAD + "frames:\n  a b: {}\n", "^line 6: frame name 'a b' must be"),
            (HEAD + "frames:\n  a: {on: b}\n  b: {on: a}\n", "^line 6: .*'a' on 'b' on 'a'"),
            (HEAD + "    <<: {keyframe: rest}\n", "^line 5: .* unknown key '<<'"),
            (HEAD + "    ? [a, b]\n    : 1\n", "^line 5: a key of robot 'left' is a list"),
            (HEAD + "---\nversion: 1\n", "^line 5: this is not YAML: .*another document"),
            ("version: 1\nrobots: [\n", "^line 3: this is not YAML"),
            ("version: 1\n\trobots: {}\n", "^line 2: this is not YAML"),
            ("version: 1\nrobots: *left\n", "^line 2: this is not YAML: .*undefined alias"),
            ("version: 1\nrobots: \x07\n", "^line 2: character 7 is not allowed"),
            ("[" * 5_000, "^this is nested too deeply"),
            ("a: &a [*a]", "^line 1: a layout has an unknown key 'a'"),
        ],
    )
    def test_an_error_names_line_problem_and_closest_match(self, text, message):
        with pytest.raises(LayoutError, match=message) as caught:
            Layout.from_yaml(text)
        assert "\n" not in str(caught.value)

    @pytest.mark.parametrize(
        "tag",
        [
            "!!python/object/apply:os.mkdir [{path}]",
            "!!python/object/new:os.mkdir [{path}]",
            "!!python/name:os.system ''",
            "!mine {{}}",
            "!!binary aGk=",
        ],
    )
    @pytest.mark.parametrize("place", ["robots", "version", "frames"])
    def test_no_tag_is_executed(self, tag, place, tmp_path):
        made = tmp_path / "made"
        lines = {"version": "1", "robots": "{left: {robot: panda}}", place: tag.format(path=made)}
        text = "\n".join(f"{key}: {value}" for key, value in lines.items())
        with pytest.raises(LayoutError, match="^line .: the tag .* is not allowed in a layout"):
            Layout.from_yaml(text)
        assert not made.exists()

    @given(st.text(max_size=60))
    def test_any_text_is_a_layout_or_a_layout_error(self, text):
        try:
            Layout.from_yaml(text)
        except LayoutError:
            pass

    @given(st.data())
    def test_a_damaged_layout_is_a_layout_or_a_layout_error(self, data):
        text = around_table({"a": "panda", "b": "so100"}).to_yaml()
        start = data.draw(st.integers(0, len(text)))
        end = data.draw(st.integers(start, min(start + 20, len(text))))
        inserted = data.draw(st.text(st.sampled_from("[]{}:,-!&*#'\"\n ab10.e"), max_size=5))
        try:
            Layout.from_yaml(text[:start] + inserted + text[end:])
        except LayoutError:
            pass


class TestFiles:
    def test_saved_and_loaded(self, tmp_path):
        layout = ring({"a": "panda", "größe": "so100", "c": "panda_stick"})
        path = layout.save(tmp_path / "new" / "cell.yaml")
        assert Layout.load(path) == layout
        assert [file.name for file in path.parent.iterdir()] == ["cell.yaml"]

    def test_an_error_names_the_file(self, tmp_path):
        path = tmp_path / "cell.yaml"
        path.write_text(HEAD + "    keyfram: rest\n")
        with pytest.raises(LayoutError, match="cell.yaml, line 5: .*Did you mean 'keyframe'"):
            Layout.load(path)
        path.write_text("")
        with pytest.raises(LayoutError, match="cell.yaml, this is empty"):
            Layout.load(path)

    def test_a_file_that_cannot_be_read(self, tmp_path):
        with pytest.raises(LayoutError, match="cannot read .*none.yaml': No such file"):
            Layout.load(tmp_path / "none.yaml")
        latin = tmp_path / "latin.yaml"
        latin.write_bytes("# größe".encode("latin-1"))
        with pytest.raises(LayoutError, match="it is not UTF-8: "):
            Layout.load(latin)

    def test_a_layout_that_cannot_be_written_leaves_the_old_file(self, tmp_path):
        path = tmp_path / "cell.yaml"
        ring({"a": "panda"}).save(path)
        before = path.read_bytes()
        mine = dataclasses.replace(RobotRegistry.load("panda"), name="mine")
        with pytest.raises(LayoutError, match="not registered"):
            ring({"a": mine}).save(path)
        assert path.read_bytes() == before
        assert list(Path(tmp_path).iterdir()) == [path]

    @pytest.mark.parametrize("kind", ["FIFO", "/dev/zero", "folder"])
    def test_what_is_no_file_is_refused_at_once(self, kind, tmp_path):
        path = tmp_path / "cell.yaml"
        if kind == "FIFO":
            os.mkfifo(path)
        elif kind == "folder":
            path.mkdir()
        else:
            path.symlink_to(kind)
        with pytest.raises(
            LayoutError, match="cannot read .*cell.yaml': it is a .*, not a regular"
        ):
            Layout.load(path)

    def test_a_file_is_bounded(self, tmp_path):
        path = tmp_path / "cell.yaml"
        path.touch()
        os.truncate(path, 5 << 30)
        with pytest.raises(LayoutError, match="it has more than 1,048,576 bytes"):
            Layout.load(path)


class TestBounds:
    @pytest.mark.parametrize("text", [None, b"version: 1", ["version: 1"], 5])
    def test_only_text_is_read(self, text):
        with pytest.raises(LayoutError, match="a layout's YAML is .*; it takes text"):
            Layout.from_yaml(text)

    def test_text_is_bounded(self):
        with pytest.raises(LayoutError, match="has 2,000,000 characters; 1,048,576 is most"):
            Layout.from_yaml("#" * 2_000_000)

    def test_words_are_bounded(self):
        with pytest.raises(LayoutError, match="line 2: keyframe has 1,000 characters; 200 is most"):
            Layout.from_yaml(f"version: 1\nrobots: {{a: {{robot: panda, keyframe: {'x' * 1000}}}}}")
        with pytest.raises(LayoutError, match="line 2: robot has 5,000 characters; 4,096 is most"):
            Layout.from_yaml(f"version: 1\nrobots: {{a: {{robot: {'x' * 5000}}}}}")

    @pytest.mark.parametrize("text", ['"\\UFFFFFFFF"', f"%YAML 1.{'9' * 5000}\n---\na: 1"])
    def test_numbers_that_yaml_cannot_read_are_refused(self, text):
        with pytest.raises(LayoutError, match="this is not YAML: "):
            Layout.from_yaml(text)

    @pytest.mark.long
    def test_a_tower_of_thousands_is_resolved(self):
        count = 3000
        robots = [f"  r{i}: {{robot: panda, on: r{i + 1}}}" for i in range(count)]
        text = "\n".join(["version: 1", "robots:", *robots, f"  r{count}: {{robot: panda}}"])
        assert len(str(Layout.from_yaml(text)).splitlines()) == count + 3
