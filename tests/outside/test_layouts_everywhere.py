"""Layouts, robots and bystanders wherever a task is made, and recordings that hold them."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

import tasks
from layouts import Layout, Placement, ring
from robot_layouts.__main__ import main
from robot_layouts.data import evaluate
from robot_layouts.data.playing.replay import open_recording, replay
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recorded_task import task_for
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.record import record
from robot_layouts.data.recording.recorder import Recorder
from robots import ActionError, RobotRegistry, TaskError
from tasks import Needs
from tasks.cell_options import chosen_robots
from tasks.engine.places import check_needs
from tasks.episode import play
from tasks.language.needs import gripper_opening
from tests.data.recordings import edited
from tests.three_links import arm, save

RELAY, PICK = "Relay-v1", "PickCube-v1"
MIXED = {"a": "panda", "b": "panda_stick", "c": "xarm7", "d": "so100", "e": "panda_wristcam"}


@pytest.fixture
def cell(tmp_path) -> Path:
    """A file of five arms of five kinds in a ring."""
    return ring(MIXED, radius="auto").save(tmp_path / "cell.yaml")


@pytest.fixture
def crowd() -> Layout:
    """PickCube's arm, and two robots that have no place there."""
    own = tasks.get_task_class(PICK).layout
    others = {
        "watcher": Placement("panda_stick", position=(0.9, 0.9, 0.0)),
        "helper": Placement("so100", position=(0.9, -0.9, 0.0)),
    }
    return Layout({"watcher": others["watcher"], **own, "helper": others["helper"]})


def record_at_random(path: Path, task: tasks.MultiRobotTask, steps: int = 4) -> Path:
    rng = np.random.default_rng(0)
    with Recorder(path, task) as recorder:
        actions = rng.uniform(-1, 1, (steps, task.layout.action_dim)).astype(np.float32)
        recorder.add(play(task, 3, actions))
    return path


def replayed(path: Path, **options):
    with Recording(path) as file:
        return replay(task_for(file, **options), file[0])


class TestRecordings:
    def test_of_five_arms_from_a_file_replay_without_it(self, cell, tmp_path, capsys):
        task = tasks.make(RELAY, layout=Layout.load(cell), obs_mode="none")
        path = record_at_random(tmp_path / "data" / "trajectory.h5", task)
        cell.unlink()
        assert main(["replay", str(path)]) == 0
        assert "in 1 all states are equal to the last bit" in capsys.readouterr().out

    def test_of_a_urdf_replay_while_it_is_the_same(self, tmp_path):
        urdf = save(tmp_path, arm())
        task = tasks.make("PushCube-v1", robots=str(urdf), obs_mode="none", check_layout=False)
        path = record_at_random(tmp_path / "trajectory.h5", task)
        assert replayed(path).difference is None
        urdf.write_text(urdf.read_text() + "<!-- changed -->")
        with pytest.raises(TrajectoryError, match=r"guessed from .*small.urdf, which has changed"):
            replayed(path)
        urdf.unlink()
        with pytest.raises(TrajectoryError, match="cannot be read .*name the robot, with --rob"):
            replayed(path)
        (tmp_path / "elsewhere").mkdir()
        again = save(tmp_path / "elsewhere", arm())
        assert replayed(path, robots={"arm": again}).difference is None

    def test_of_a_robot_that_is_unknown_here_name_it(self, tmp_path):
        path = record_at_random(tmp_path / "trajectory.h5", tasks.make("PushCube-v1"))
        with edited(path) as file:
            layout = json.loads(file.attrs["layout"])
            layout["arm"]["robot"] = "pandda"
            file.attrs["layout"] = json.dumps(layout)
        with pytest.raises(TrajectoryError, match="a robot at 'arm' that is not available here"):
            replayed(path)

    @pytest.mark.parametrize("mode", ["pd_joint_delta_pos", "pd_ee_delta_pos"])
    @pytest.mark.parametrize("bystanders", ["hold", "act"])
    def test_of_bystanders(self, crowd, tmp_path, bystanders, mode):
        task = tasks.make(
            PICK, layout=crowd, bystanders=bystanders, obs_mode="none", control_mode=mode
        )
        path = record_at_random(tmp_path / "trajectory.h5", task)
        assert replayed(path).difference is None

    @pytest.mark.long
    def test_of_five_arms_from_the_command_line(self, cell, tmp_path, capsys):
        cell = ring({**MIXED, "d": "panda"}, radius="auto").save(cell)
        out = str(tmp_path / "data")
        words = ["--task", RELAY, "--layout", str(cell), "--episodes", "2", "--workers", "2"]
        assert main(["record", *words, "--out", out]) == 0
        assert main(["replay", out]) == 0
        assert "in 2 all states are equal to the last bit" in capsys.readouterr().out


class TestFunctions:
    def test_record_takes_robots(self, tmp_path):
        summary = record("PushCube-v1", [0], tmp_path, workers=0, robots="panda_stick")
        assert summary.recorded == 1
        with open_recording(tmp_path, None) as file:
            assert file.layout["arm"]["robot"] == "panda_stick"
            assert replay(task_for(file), file[0]).agrees

    def test_evaluate_takes_a_layout(self, cell):
        found = evaluate(Idle(), RELAY, [0], workers=0, layout=Layout.load(cell))
        assert not found.success_rate

    def test_describe_takes_them(self, cell, capsys):
        assert main(["tasks", "describe", RELAY, "--layout", str(cell)]) == 0
        assert "5 robots" in capsys.readouterr().out
        assert main(["tasks", "describe", PICK, "--robots", "arm=pandda"]) == 2
        assert main(["tasks", "describe", PICK, "--robots", "arm=panda", "panda"]) == 1
        assert "'panda' should be PLACE=ROBOT" in capsys.readouterr().err

    def test_one_robot_needs_no_place(self):
        assert chosen_robots(["panda"]) == RobotRegistry.load("panda")


class Idle:
    """A policy that does nothing."""

    def __call__(self, obs):
        layout = ring(MIXED, radius="auto")
        return torch.zeros(layout.action_dim)


class TestBystanders:
    def test_are_refused_unless_asked_for(self, crowd):
        with pytest.raises(TaskError, match=r"bystanders='hold' lets \['watcher', 'helper'\]"):
            tasks.make(PICK, layout=crowd)

    @pytest.mark.parametrize("mode", ["pd_joint_pos", "pd_joint_vel", "pd_ee_delta_pose"])
    def test_that_hold_do_so_in_every_control_mode(self, mode):
        """Also Fetch, whose head and torso move by steps in every mode of its own."""
        own = tasks.get_task_class(PICK).layout
        fetch = Placement("fetch", position=(2.0, 2.0, -0.92))
        layout = Layout({**own, "fetch": fetch})
        env = tasks.make(PICK, layout=layout, bystanders="hold", control_mode=mode)
        alone = tasks.make(PICK, control_mode=mode)
        assert env.single_action_space == alone.single_action_space

    def test_a_limb_without_a_place_holds_still(self):
        own = tasks.get_task_class(PICK).layout
        dual = Placement("mobile_panda_dual", position=(2.5, 0.0, 1.0))
        layout = Layout({**own, "cell": dual})
        env = tasks.make(PICK, layout=layout, bystanders="hold")
        assert env.single_action_space.shape == (8,)
        acting = tasks.make(PICK, layout=layout, bystanders="act", control_mode="pd_ee_delta_pose")
        assert [p.stop - p.start for p in acting.action_split.values()] == [7, 7, 7, 1]

    def test_that_hold_take_no_numbers_and_change_no_episode(self, crowd):
        env = tasks.make(PICK, layout=crowd, bystanders="hold", num_envs=2)
        alone = tasks.make(PICK, num_envs=2)
        assert env.single_action_space.shape == (8,)
        assert env.action_split == {
            "watcher": slice(0, 0), "arm": slice(0, 8), "helper": slice(8, 8),
        }  # fmt: skip
        env.reset(seed=5)
        alone.reset(seed=5)
        here, there = env.simulation.read(), alone.simulation.read()
        assert np.array_equal(here.pose("cube"), there.pose("cube"))
        assert np.array_equal(here.qpos("arm"), there.qpos("arm"))
        start = here.qpos("watcher").copy()
        assert np.allclose(start, crowd["watcher"].start_qpos)
        for _ in range(5):
            env.step({"arm": torch.ones(2, 8)})
        assert np.abs(env.simulation.read().qpos("watcher") - start).max() < 0.01

    def test_that_act_take_numbers(self, crowd):
        env = tasks.make(PICK, layout=crowd, bystanders="act")
        assert env.single_action_space.shape == (7 + 8 + 6,)
        with pytest.raises(ActionError, match=r"no numbers for \['watcher', 'helper'\]"):
            env.step({"arm": torch.zeros(1, 8)})

    def test_that_hold_are_no_agents(self, crowd):
        env = tasks.parallel_env(PICK, layout=crowd, bystanders="hold")
        assert env.possible_agents == ["arm"]
        env.reset(seed=0)
        env.step({"arm": np.zeros(8, np.float32)})

    def test_the_expert_plays_among_them(self, crowd, tmp_path):
        assert record(PICK, [0], tmp_path, workers=0, layout=crowd, bystanders="hold").played[0]

    def test_take_a_word_that_there_is(self, crowd):
        with pytest.raises(TaskError, match="bystanders"):
            tasks.make(PICK, layout=crowd, bystanders="dance")


class TestNeeds:
    @pytest.mark.parametrize(
        ("needs", "robot", "words"),
        [
            (Needs(fingers=True), "panda_stick", "fingers that grasp, and it has none"),
            (Needs(opening=0.05), "panda_stick", "fingers that grasp"),
            (Needs(opening=0.1), "panda", "a gripper that opens 0.1 m, and its own opens 0.08 m"),
            (Needs(reach=0.6), "so100", "a reach of 0.6 m, and its own is"),
            (Needs(tcp_is_link=True), "so100", "a TCP that is a link, and its own is a point"),
            (Needs(joints=("waist",)), "panda", "the joints waist, and it does not drive them"),
        ],
    )
    def test_what_is_missing_is_said(self, needs, robot, words):
        layout = Layout({"arm": Placement(robot)})
        with pytest.raises(TaskError, match=f"^Lift, place 'arm' needs {words}"):
            check_needs("Lift", layout, layout, {"*": needs})
        check_needs("Lift", layout, layout, {})

    def test_a_panda_has_them_all(self):
        needs = Needs(fingers=True, opening=0.08, reach=0.8, tcp_is_link=True)
        assert not list(needs.missing(RobotRegistry.load("panda")))
        assert gripper_opening(RobotRegistry.load("so100")) is None  # jaws that swing

    def test_of_a_place_that_there_is_not(self):
        layout = Layout({"arm": Placement("panda")})
        with pytest.raises(TaskError, match=r"Lift.needs names 'left'; the places are \['arm'\]"):
            check_needs("Lift", layout, layout, {"left": Needs()})

    @pytest.mark.parametrize(
        "fields",
        [{"opening": -1}, {"reach": float("nan")}, {"fingers": 1}, {"joints": "waist"}],
    )
    def test_that_nobody_can_have(self, fields):
        with pytest.raises(TaskError):
            Needs(**fields)

    def test_a_grasp_without_fingers_warns(self):
        env = tasks.make(PICK, robots="panda_stick")
        with pytest.warns(RuntimeWarning, match="'arm' has no fingers, so that is_grasping"):
            env.step(torch.zeros(1, 7))
