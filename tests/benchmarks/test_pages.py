"""Every page is what its record says, and the records keep what the pages promise."""

import json
import shutil
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path

import pytest

pytest.importorskip("matplotlib")

from benchmarks.__main__ import main
from benchmarks.experts import BAR, BODIES, PAIRS, TASKS, lift_bar, standing
from benchmarks.ladder import FIRST_TEST, OWN
from benchmarks.objects import NAMES, digest_of, kind_of
from benchmarks.placing import CELLS, targets_of
from benchmarks.processors import PORTABLE
from benchmarks.records import DOCS, RecordError, as_text, read_record, render, write_record
from benchmarks.robots.judge import EXPECTED, expected_of, read_expectations
from benchmarks.rungs import Imitation, LeRobot, Reinforced
from benchmarks.skills import robot_of
from objects import ObjectRegistry
from objects.registry import CATALOGUE
from robot_layouts.data.receipts import Receipt
from robot_layouts.data.receipts.provenance import describe_task
from robot_layouts.data.suite.results import result_of
from tasks import Needs, get_task_class
from tasks.episode import play

ROOT = DOCS.parent
COMMANDS = {
    "robots": ["robots", "--render"],
    "mjcf": ["mjcfs", "--render"],
    "placing": ["placing"],
    "objects": ["objects", "--objects", "mug"],  # which needs no package
    "experts": ["experts", "--tasks", "--pair-seeds", "0"],
    "cells_robots": ["cells", "--tasks"],
    "datasets": ["datasets", "--tasks"],
    "engines": ["engines", "--tasks"],
    "device": ["agreement", "--tasks"],
    "conversions": ["conversions", "--modes", "--tasks", "PickCube-v1"],
    "processors": ["processors", "--render"],
    "imitation": ["imitation"],
    "reinforcement": ["reinforcement"],
    "ladder": ["ladder", "--tasks"],
}
LEARNED = ("imitation", "reinforcement")
RECEIPTS = [path for name in LEARNED for path in sorted((DOCS / "receipts" / name).glob("*.json"))]


def record(name: str) -> dict:
    return json.loads((DOCS / f"{name}.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", COMMANDS)
def test_a_page_shows_its_record(name, tmp_path):
    out = Path(shutil.copy(DOCS / f"{name}.json", tmp_path))
    assert main([*COMMANDS[name], "--out", str(out)]) == 0
    assert out.with_suffix(".md").read_text() == (DOCS / f"{name}.md").read_text()


@pytest.mark.parametrize("name", COMMANDS)
def test_what_is_no_record_is_left_alone(name, tmp_path, capsys):
    out = tmp_path / "seen.json"
    out.write_text("[]")
    assert main([*COMMANDS[name], "--out", str(out)]) == 2
    assert f"error: cannot read {out}" in capsys.readouterr().err
    assert (out.read_text(), out.with_suffix(".md").exists()) == ("[]", False)


def test_the_page_of_planning_shows_its_record():
    assert render("planning", **record("planning")) == (DOCS / "planning.md").read_text()


def test_the_tables_of_benchmarks_are_fresh(capsys):
    assert main(["tables", "--check"]) == 0, capsys.readouterr().err


def test_a_record_is_read_as_it_was_written(tmp_path):
    written = {"versions": {"a": "1"}, "tasks": {"b": [[1, 2], []], "c": "x\n [y]"}}
    assert '"versions": {"a": "1"}' in as_text(written)
    write_record(tmp_path / "a.json", written)
    assert read_record(tmp_path / "a.json", versions={}) == written
    assert read_record(tmp_path / "none.json", tasks={}) == {"tasks": {}}
    with pytest.raises(RecordError, match=r"cannot read .*a\.json: KeyError\('runs'\)"):
        read_record(tmp_path / "a.json", runs={})


def test_every_robot_of_the_survey_is_known_with_its_joints():
    expectations = read_expectations(EXPECTED)
    for key, seen in record("robots")["robots"].items():
        expected = expected_of(key, expectations)
        assert expected.kind != "unknown", key
        groups = seen.get("loads", {}).get("groups", {})
        joints = [joint for group in groups.values() for joint in group["joints"]]
        for limb in expected.arms.values() if joints else ():
            for pattern in (*limb.joints, *limb.gripper):
                assert any(Path(joint).match(pattern) for joint in joints), (key, pattern)


def test_what_the_page_of_objects_promises():
    seen = record("objects")["objects"]
    assert list(seen) == list(NAMES)
    assert sum(bool(one["joints"]) for one in seen.values()) >= 25
    for name, one in seen.items():
        assert max(one["drift"].values()) < 1.0, name  # mm
        assert one["licence"] in ("Apache-2.0", "MIT", "Zlib"), name
        assert f"## {name}\n" in (DOCS / "objects" / f"{kind_of(name)}.md").read_text()
    for name in CATALOGUE:
        one = seen[name]
        assert one["digest"] == digest_of(ObjectRegistry.load(name)), name
        if ObjectRegistry.load(name).grasps:
            assert max(held for held, _ in one["grasps"].values()) >= 20, name


def test_what_the_page_of_placing_promises():
    assert list(record("placing")["cells"]) == list(CELLS)
    for name, cell in record("placing")["cells"].items():
        assert cell["search"]["clear"], name
        assert cell["search"]["reached"] == len(set(targets_of(CELLS[name]))) == 12, name
        assert cell["search"]["shared"] >= 1.3 * cell["ring"]["shared"], name
        assert cell["search"]["clearance"] >= 0.1, name


def test_what_the_page_of_experts_promises():
    assert list(record("experts")["tasks"]) == list(TASKS)
    for task_id, seen in record("experts")["tasks"].items():
        others = [other for other in seen["others"].values() if "layout" in other]
        elsewhere = [episode for other in others for episode in other["episodes"].values()]
        own = [*seen["own"].values()]
        assert (len(others), len(own), len(elsewhere)) == (10, 100, 100), task_id
        assert sum(episode["success"] for episode in own) >= 0.98 * len(own), task_id
        assert sum(episode["success"] for episode in elsewhere) >= 0.95 * len(elsewhere), task_id
        assert not any(episode["touching"] for episode in own + elsewhere), task_id


def test_what_the_page_of_cells_promises():
    """All roles that admit a robot are filled with it, in every cell that was tried."""
    for task_id, of in record("cells_robots")["cells"].items():
        cls = get_task_class(task_id)
        for name, seen in of.items():
            admitted = {
                role
                for role in cls.layout
                if robot_of(name).fingers is not None
                or not cls.needs.get(role, cls.needs.get("*", Needs())).fingers
            }
            assert seen["robots"] == dict.fromkeys(sorted(admitted, key=[*cls.layout].index), name)
            assert seen["episodes"]


@pytest.mark.parametrize(
    ("task", "hands"),
    [
        ("TwoRobotHandOver-v1", ("panda", "so100", "so101")),
        (BAR, ("panda", "xarm7_with_panda", "ur3_with_panda", "ur5_with_panda")),
        ("Relay-v1", ("panda", "so100", "ur3_with_panda", "ur5_with_panda", "ur10_with_panda")),
    ],
)
def test_what_the_page_of_experts_promises_of_pairs(task, hands):
    pairs = record("experts")["pairs"][task]
    assert pairs.keys() <= {*(", ".join(pair) for pair in PAIRS), *BODIES}
    for pair in (pair for hand in hands for pair in (f"{hand}, {hand}", f"panda, {hand}")):
        episodes = pairs[pair]["episodes"].values()
        assert sum(episode["success"] for episode in episodes) >= 0.8 * len(episodes) > 0, pair
        assert not any(episode["touching"] for episode in episodes), pair


def test_jaws_that_swing_hold_a_bar_firmly_before_they_lift_it():
    with closing(standing(BAR, ("so101", "so101"))) as task:
        assert 0.3 < task.task.fit.scale < 0.5  # of the bar
        assert play(task, 0, lift_bar(task, 0)).solved


def module_of(recipe):
    """Return which module plays what a rung of the ladder has learned."""
    learner = recipe.get("policy", "pictures" if "size" in recipe else "")
    if learner in Reinforced.LIBRARIES:
        return f"{learner}_two_arms"
    examples = {"": "imitate", "pictures": "imitate_images"}
    return examples.get(learner, "lerobot_env_robot_layouts.policies")


def test_what_the_page_of_the_ladder_promises():
    seen = record("ladder")["tasks"]
    assert sum(len(one["arms"]) >= 3 for one in seen.values()) >= 4
    assert sum(not {"xarm7", "ur10"}.isdisjoint(one["arms"]) for one in seen.values()) >= 2
    for one in seen.values():
        recipe = one["recipe"]
        for name, found in one["layouts"].items():
            receipt = Receipt.read(DOCS / "receipts" / "ladder" / found["receipt"])
            result = result_of(receipt.episodes)
            tested = range(FIRST_TEST, FIRST_TEST + 50)
            assert [episode.seed for episode in receipt.episodes] == [*tested]
            assert (found["solved"], found["episodes"]) == (result.successes, result.episodes)
            assert (found["steps"], found["stage_score"]) == (result.length, result.stage_score)
            assert {*found["touching"]} <= {*tested}
            assert bool(receipt.making["randomization"]) == (name != OWN)
            assert receipt.policy["name"] == f"{module_of(recipe)}:policy"
            assert receipt.policy["files"]
            assert receipt.task == describe_task(get_task_class(recipe["task"]))
            robots = [place["robot"] for place in receipt.making["layout"].values()]
            assert robots == one["arms"]


@pytest.mark.parametrize(
    ("learner", "package", "error"),
    [
        ("act", "lerobot", "act is trained by LeRobot, which is not installed"),
        ("mappo", "torchrl", "mappo learns with torchrl, which is not installed"),
    ],
)
def test_the_ladder_says_what_it_lacks(learner, package, error, tmp_path, capsys):
    if find_spec(package) is not None:
        pytest.skip(f"{package} is installed")
    words = ["--learner", learner, "--tasks", "CellCloseDrawers-v1"]
    assert main(["ladder", *words, "--runs", str(tmp_path), "--out", str(tmp_path / "l.json")]) == 2
    assert f"error: {error}" in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (["--learner", "ppo", "--pictures"], "--pictures goes with --learner imitation"),
        (["--learner", "mappo", "--episodes", "9"], "mappo learns from no expert's episodes"),
    ],
)
def test_the_ladder_refuses_what_a_learner_does_not_take(words, error, tmp_path, capsys):
    assert main(["ladder", *words, "--out", str(tmp_path / "l.json")]) == 2
    assert error in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]


def test_runs_of_the_ladder_are_named_by_what_sets_them_apart():
    assert Reinforced("A").name == "A_ppo"
    assert Reinforced("A", "xarm7", 1, steps=10, learner="mappo").name == "A_xarm7_mappo_10_seed1"
    assert Imitation("A", episodes=10, pictures=True).name == "A_pictures_10x4000"
    assert LeRobot("A", learner="diffusion").name == "A_diffusion"


def test_nothing_portable_differs():
    settings = record("processors")["settings"].values()
    compared = [seen for seen in settings if seen["against"] == PORTABLE]
    assert len(compared) >= 1
    assert all(seen["episodes"] >= 10 and not seen["different"] for seen in compared)


def test_every_run_has_a_receipt():
    assert len(RECEIPTS) == sum(len(record(name)["runs"]) for name in LEARNED) > 0


@pytest.mark.parametrize("path", RECEIPTS, ids=lambda path: path.stem)
def test_a_receipt_is_of_the_run(path):
    """The example may have changed since, which `verify` says; what it played is compared there."""
    receipt = Receipt.read(path)
    task, _, how = path.stem.partition("_")
    name = f"{task}, from pictures" if how == "pictures" else f"{task}, {how}" if how else task
    run = record(path.parent.name)["runs"][name]
    first, last = run["test_seeds"]
    assert [episode.seed for episode in receipt.episodes] == [*range(first, last + 1)]
    assert [episode.seed for episode in receipt.episodes if not episode.success] == run["failed"]
    example = receipt.policy["name"].partition(":")[0]
    assert (ROOT / "examples" / f"{example}.py").exists()
    assert receipt.policy["files"]
    assert receipt.task == describe_task(get_task_class(receipt.task["id"]))
