"""``robot-layouts tasks list`` and ``describe``: what they print, and how they fail."""

import json

import pytest

import tasks
from robot_layouts.__main__ import main
from robots import TaskError
from tasks.description import facts, parity_verdicts, read_docstring
from tasks.registry import CATALOGUE
from tests.quick import quick_cases


class Waiting(tasks.MultiRobotTask):
    """Wait for
    nothing.

    A number is drawn.

    Nothing else is. Success: at
    once, within 1 s.

    Attributes:
        patience: How long.
    """


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(["tasks", *arguments]) == 0
    printed = capsys.readouterr()
    # The first test that needs a robot's files in a fresh checkout fetches them, and says so.
    said = [line for line in printed.err.splitlines() if not line.startswith("robot files: ")]
    assert said == []
    return printed.out


@pytest.fixture
def only_pick_cube_recorded(monkeypatch):
    monkeypatch.setattr("tasks.commands.parity_verdicts", lambda: {"PickCube-v1": "bitwise"})
    monkeypatch.setattr("tasks.commands.list_tasks", lambda: tuple(CATALOGUE))


def test_list_has_a_row_for_every_task(capsys, only_pick_cube_recorded):
    rows = {
        line.split()[0]: line.split() for line in run(capsys, "list").splitlines() if line.split()
    }
    for task_id in CATALOGUE:
        assert task_id in rows
    assert rows["PickCube-v1"] == (
        "PickCube-v1 panda 8 42 50 norm dense sparse none bitwise robot-layouts".split()
    )
    assert rows["TwoRobotPickCube-v1"][1:7] == ["2", "×", "panda_wristcam", "16", "66", "100"]
    assert rows["TwoRobotPickCube-v1"][-2:] == ["–", "robot-layouts"]
    robot = "unitree_g1_simplified_upper_body_with_head_camera"
    assert rows["UnitreeG1PlaceAppleInBowl-v1"][1:3] == [robot, "25"]


@pytest.mark.parametrize("task_id", quick_cases(CATALOGUE))
def test_describe_accounts_for_every_number(task_id, capsys):
    cls, about = tasks.get_task_class(task_id), facts(task_id)
    lines = [line.split() for line in run(capsys, "describe", task_id).splitlines()]
    rows = [line for line in lines if len(line) > 4 and line[0].isdigit()]
    numbers = [row for row in rows if row[1] in cls.layout]
    layout, actions = numbers[: len(cls.layout)], numbers[len(cls.layout) :]
    assert [line[1] for line in layout] == list(cls.layout)
    assert [line[0] for line in actions] == [str(i) for i in range(about.action_size)]
    assert all(line[-1] in ("rad", "m", "step") for line in actions)
    start = 0
    entries = lines[lines.index(["entry", "slice", "size", "sensed"]) + 2 :]
    for name, part, size, sensed in entries[: entries.index([])]:
        assert part == f"{start}:{start + int(size)}"
        assert sensed == "yes" if name.endswith((".qpos", "tcp_pose")) else sensed in ("yes", "no")
        start += int(size)
    assert start == about.observation_size


def test_describe_takes_any_name_and_says_the_rest(capsys):
    printed = " ".join(run(capsys, "describe", "ManiSkill.pick_cube_native").split())
    for text in (
        "PickCube-v1: Grasp a cube from the table and hold it still at a goal in the air.",
        "randomization Cube and goal are drawn from a square of 0.2 m",
        "success the cube is within 2.5 cm of the goal and the arm is static.",
        "episode 50 steps, 20 per s",
        "reward modes normalized_dense (default), dense, sparse, none",
        "source mani_skill 3.0.1, envs/tasks/tabletop/pick_cube.py",
        "other names maniskill.pick_cube_native, pick_cube_native",
        "Layout: 1 robot, 8 action numbers",
        "0 arm arm.panda_joint1 -0.1 +0.1 rad per step",
        "7 arm gripper -0.01 0.04 m",
        "Observation, 42 numbers",
        "is_grasped 18:19 1 yes",
        "obj_pose 29:36 7 no",
        "base_camera at (0.3, 0, 0.6), towards (-0.1, 0, 0.1) m 128 × 128 90°",
    ):
        assert text in printed


def test_describe_tells_of_the_cameras_that_ride_on_robots(capsys):
    printed = " ".join(run(capsys, "describe", "TwoRobotPickCube-v1").split())
    assert "panda_wristcam-1-hand_camera on right, link camera_link 128 × 128 90°" in printed


def test_brackets_are_not_markup(capsys):
    assert "[-0.2, -0.1], the goal" in run(capsys, "describe", "TwoRobotPickCube-v1")


def test_an_unknown_task_takes_one_line(capsys):
    assert main(["tasks", "describe", "PikCube-v1"]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert "unknown task 'PikCube-v1'. Did you mean 'PickCube-v1'?" in printed.err


def test_other_errors_take_one_line(capsys, monkeypatch, tmp_path):
    broken = tmp_path / "results.json"
    broken.write_text("[]")
    monkeypatch.setattr("tasks.commands.parity_verdicts", lambda: parity_verdicts(broken))
    assert main(["tasks", "list"]) == 1
    printed = capsys.readouterr()
    assert printed.err.startswith(f"error: {broken} is not a record of comparisons")
    assert (printed.out, printed.err.count("\n")) == ("", 1)


def test_bad_usage(capsys):
    with pytest.raises(SystemExit) as stop:
        main(["tasks", "describe"])
    assert stop.value.code == 2
    assert "usage: robot-layouts tasks describe" in capsys.readouterr().err
    assert main(["tasks", "prevew"]) == 2
    assert "Did you mean 'tasks preview'?" in capsys.readouterr().err


class TestVerdicts:
    def test_of_a_record(self, tmp_path):
        record = tmp_path / "results.json"
        record.write_text(json.dumps({"tasks": {"A": {"equal": True}, "B": {"equal": False}}}))
        assert parity_verdicts(record) == {"A": "bitwise", "B": "differs"}

    def test_without_a_record(self, tmp_path):
        assert parity_verdicts(tmp_path / "none.json") == {}

    @pytest.mark.parametrize("text", ["", "{}", '{"tasks": {"A": {}}}', '{"tasks": [1]}'])
    def test_of_something_else(self, tmp_path, text):
        (tmp_path / "r.json").write_text(text)
        with pytest.raises(TaskError, match="is not a record of comparisons"):
            parity_verdicts(tmp_path / "r.json")


def test_a_docstring_has_parts():
    said = read_docstring(Waiting)
    assert said.summary == "Wait for nothing."
    assert said.randomization == "A number is drawn.\nNothing else is."
    assert said.success == "at once, within 1 s."
