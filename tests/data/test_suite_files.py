"""Suites as files: what they include, what they are called, and what is refused."""

from dataclasses import replace
from pathlib import Path

import pytest

from layouts import Layout, face_to_face
from robot_layouts.data.suite.suite import (
    SHIPPED,
    Case,
    Suite,
    load_suite,
    read_seeds,
    save_suite,
    write_seeds,
)
from robots import TaskError, UnknownNameError
from tasks import Randomization
from tasks.registry import CATALOGUE
from tests.data.suites import written

SHARED = "name: x\nseeds: 1\ntasks:"
FRONT = "{left: panda, right: panda}"
ARMS = {"left": "panda_wristcam", "right": "panda_wristcam"}
WHOLE = """
name: mine
seeds: 0-9
policies: {PickCube-v1: lab:POLICY, others: expert}
tasks:
  - PickCube-v1
  - task: TwoRobotPickCube-v1
    seeds: [0-2, 7]
    layouts:
      own: own
      file: cells/near.yaml
      preset: {preset: face_to_face, robots: {left: panda_wristcam, right: panda_wristcam}, spacing: 1.4}
      written:
        robots:
          left: {robot: panda_wristcam, position: [0, -0.7, 0], rpy: [0, 0, 1.5707963]}
          right: {robot: panda_wristcam, position: [0, 0.7, 0], rpy: [0, 0, -1.5707963]}
  - task: maniskill.pick_cube_native
    name: Heavy
    control_mode: pd_joint_pos
    obs_mode: state_dict
    randomization: {mass: {cube: {uniform: [0.5, 2.0]}}}
"""  # noqa: E501


@pytest.fixture
def whole(tmp_path) -> Path:
    (tmp_path / "cells").mkdir()
    face_to_face(ARMS, spacing=1.3).save(tmp_path / "cells" / "near.yaml")
    return written(tmp_path, WHOLE)


def test_it_is_read_with_all_that_it_includes(whole):
    suite = load_suite(whole)
    cases = {case.name: case for case in suite.cases}
    two = "TwoRobotPickCube-v1"
    assert list(cases) == [
        "PickCube-v1", two, f"{two}.file", f"{two}.preset", f"{two}.written", "Heavy"
    ]  # fmt: skip
    assert cases["PickCube-v1"].seeds == tuple(range(10))
    assert cases[two].seeds == (0, 1, 2, 7)
    assert cases[two].layout is None
    assert cases[f"{two}.file"].layout == face_to_face(ARMS, spacing=1.3)
    assert cases[f"{two}.preset"].layout == face_to_face(ARMS, spacing=1.4)
    assert cases[f"{two}.written"].layout["right"].position == (0.0, 0.7, 0.0)
    heavy = cases["Heavy"]
    assert (heavy.task, heavy.control_mode) == ("PickCube-v1", "pd_joint_pos")
    assert heavy.randomization == Randomization(mass={"cube": {"uniform": [0.5, 2.0]}})
    assert suite.policies == {"PickCube-v1": "lab:POLICY", "others": "expert"}
    assert suite.episodes == 10 + 4 * 4 + 10


def test_it_is_written_with_all_that_it_includes(whole, tmp_path):
    suite = load_suite(whole)
    save_suite(suite, tmp_path / "other" / "all.yaml")
    again = load_suite(tmp_path / "other" / "all.yaml")
    assert again == suite
    assert again.hash == suite.hash


def test_the_hash_is_of_what_is_played(whole):
    suite = load_suite(whole)
    same = replace(suite, name="other", policies={}, cases=suite.cases[::-1])
    assert same.hash == suite.hash
    assert suite.id == suite.hash[:12]
    changed = [
        {"seeds": "0-8"},
        {"name": "Light"},
        {"control_mode": None},
        {"obs_mode": "state"},
        {"randomization": None},
    ]
    *others, heavy = suite.cases
    hashes = {replace(suite, cases=(*others, replace(heavy, **one))).hash for one in changed}
    assert len(hashes - {suite.hash}) == len(changed)


def test_names_may_differ_by_capitals_alone(tmp_path):
    text = f"{SHARED} [{{task: PickCube-v1, name: a}}, {{task: PickCube-v1, name: A}}]"
    assert [case.name for case in load_suite(written(tmp_path, text)).cases] == ["a", "A"]


def test_the_hash_is_of_the_content_of_layouts(whole):
    before = load_suite(whole)
    file = whole.parent / "cells" / "near.yaml"
    file.write_text(f"# a remark\n{file.read_text()}")
    assert load_suite(whole).hash == before.hash
    face_to_face(ARMS, spacing=1.31).save(file)
    assert load_suite(whole).hash != before.hash


# Newer than the suite, which never changes.
LATER = "Cell", "FMBAssembly1Easy", "RotateValve", "TableTop", "TwoRobotHandOver", "UnitreeG1"
NEWER = {name for name in CATALOGUE if name.startswith(LATER)}


def test_the_standard_suite():
    """If it has changed, papers that name its hash speak of another one: give it a new name."""
    suite = load_suite("standard")
    assert {case.task for case in suite.cases} == {*CATALOGUE} - NEWER
    assert all(case.seeds == tuple(range(100)) and case.layout is None for case in suite.cases)
    assert suite.id == "5bcba24a6284"
    assert suite.name == "standard"


@pytest.mark.parametrize(
    ("value", "seeds"),
    [
        (7, (7,)),
        (7.0, (7,)),
        ("0-3", (0, 1, 2, 3)),
        ("5, 0 - 2", (0, 1, 2, 5)),
        (["8-9", 3.0], (3, 8, 9)),
        (range(2), (0, 1)),
    ],
)
def test_seeds(value, seeds):
    assert read_seeds(value) == seeds
    assert read_seeds(write_seeds(seeds)) == seeds


@pytest.mark.parametrize(
    ("value", "complaint"),
    [
        ("0-3, 2", "seed 2 is there twice"),
        ("9-0", "seeds 9-0 end before they begin; write 0-9"),
        ([], r"seeds is \[\]; one or more are needed"),
        ("some", "seeds is 'some'; it takes 0-99, 7, or a list of such"),
        (0.5, "seeds is 0.5; it takes"),
        ("0-4294967295", "seeds are 4,294,967,296; 100,000 are most"),
        (4294967296, r"seed 4294967296 must lie from 0 to 2\*\*32 - 1"),
    ],
)
def test_what_are_no_seeds(value, complaint):
    with pytest.raises(TaskError, match=complaint):
        read_seeds(value)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("name: x\nseeds: 0-9\ntasks: []", "the suite x is empty; it needs 'tasks', a list"),
        ("seeds: 0-9\ntasks: [PickCube-v1]", "the name of a suite is None; it takes up to 100"),
        ("name: x\nseed: 1\ntasks: [PickCube-v1]", "unknown key of a suite 'seed'. Did you mean"),
        ("name: x\ntasks: [PickCube-v1]", r"task 1 \(PickCube-v1\): 'seeds' is missing"),
        ("name: x\nname: y\n", "'name' is there twice"),
        ("name: [x", "suite_of_mine.yaml, line"),
        (f"{SHARED} [PickCub-v1]", r"task 1 \(PickCub-v1\): unknown task 'PickCub-v1'. Did you"),
        (f"{SHARED} [{{seeds: 2}}]", "task 1: 'task' is missing"),
        (f"{SHARED} [PickCube-v1, pick_cube]", "two cases are called PickCube-v1; give one of t"),
        (f"{SHARED} [{{task: PickCube-v1, layot: own}}]", "Did you mean 'layout'?"),
        (f"control_mode: pd_join_pos\n{SHARED} [PickCube-v1]", "'pd_join_pos' is not offered"),
        (f"randomization: {{mas: 1}}\n{SHARED} [PickCube-v1]", "Did you mean 'mass'?"),
        (f"randomization: [mass]\n{SHARED} [PickCube-v1]", "it takes a file, or axes by name"),
        (f"policies: {{PickCube-v1: 3}}\n{SHARED} [PickCube-v1]", "must be MODULE:NAME"),
    ],
)
def test_what_is_no_suite(text, complaint, tmp_path):
    path = written(tmp_path, text)
    with pytest.raises(TaskError, match=complaint) as caught:
        load_suite(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("layout", "complaint"),
    [
        ("layout: 3", "a layout is 3.0; it takes 'own', a file, a preset"),
        ("layout: no.yaml", "cannot read the layout '.*no.yaml'"),
        ("layouts: {}", "layouts is empty; leave it out for the task's own"),
        ("layout: own, layouts: {own: own}", "it has 'layout' and 'layouts'; the latter"),
        ("layout: {preset: rin, robots: {a: panda}}", "layout preset 'rin'. Did you mean 'ring'?"),
        ("layout: {preset: ring}", "ring needs 'robots'"),
        (
            "layout: {robots: {arm: {robot: pandas}}}",
            r"task 1 .PickCube-v1.: unknown robot 'pandas'. Did you mean 'panda'",
        ),
        (
            f"layout: {{preset: face_to_face, robots: {FRONT}, spacing: 1}}",
            r"PickCube has the places \['arm'\]",
        ),
    ],
)
def test_what_is_no_layout(layout, complaint, tmp_path):
    path = written(tmp_path, f"{SHARED} [{{task: PickCube-v1, {layout}}}]")
    with pytest.raises(TaskError, match=complaint):
        load_suite(path)


def test_what_is_not_there(tmp_path):
    with pytest.raises(UnknownNameError, match="unknown suite 'standart'. Did you mean 'standard'"):
        load_suite("standart")
    with pytest.raises(TaskError, match="cannot read the suite .*no.yaml"):
        load_suite(tmp_path / "no.yaml")
    assert all(path.is_file() for path in SHIPPED.values())


def test_a_robot_that_no_file_can_name(tmp_path):
    place = next(iter(face_to_face(ARMS, spacing=1.4).values()))
    own = replace(place, robot=replace(place.robot, name="mine"))
    case = Case("PickCube-v1", (0,), layout=Layout({"arm": own}))
    with pytest.raises(ValueError, match="the robot 'mine' of 'arm' is not registered"):
        save_suite(Suite("x", (case,)), tmp_path / "x.yaml")
    assert not (tmp_path / "x.yaml").exists()


def test_it_shows_what_is_played(whole):
    first, *lines = str(load_suite(whole)).splitlines()
    assert first.endswith(": 36 episodes, 6 cases")
    assert lines[0] == "  PickCube-v1: seeds 0-9"
    assert lines[-1] == (
        "  Heavy: seeds 0-9; PickCube-v1; pd_joint_pos; observes state_dict; randomized"
    )
