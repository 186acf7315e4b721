"""``robot-layouts view``, and ``robot-layouts tasks view --demo``, which hands over to it."""

import subprocess
import sys

import numpy as np
import pytest

import robot_layouts as rl
from benchmarks.teleop import served
from robot_layouts.__main__ import main
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.viewing import episode_cell
from tests.data.recordings import LEFT_KEY, TWO_ROBOTS, edited, read, record
from tests.pages import browser_page, changed, settled

STEPS = 6


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return record(tmp_path_factory.mktemp("demo") / "trajectory.h5", TWO_ROBOTS, [3, STEPS])


def test_the_motion_is_the_recorded_one(recording):
    with Recording(recording) as file:
        cell = episode_cell(file, 1)
    recorded = read(recording)[1]
    motion = cell.motion
    assert cell.title == "TwoRobotPickCube-v1, episode 1 of trajectory.h5"
    assert len(motion) == STEPS + 1
    assert motion.step_seconds == pytest.approx(1 / 20)
    np.testing.assert_array_equal(motion.qpos["left"], recorded.qpos(LEFT_KEY))
    np.testing.assert_array_equal(motion.poses["cube"], recorded.poses("cube"))
    assert np.ptp(motion.qpos["right"], axis=0).max() > 0.01
    assert {"cube", "table-workspace", "ground"} <= set(cell.things)


@pytest.mark.long
def test_a_file_without_states_is_played_again(recording, tmp_path):
    path = tmp_path / "trajectory.h5"
    for suffix in (".h5", ".json"):
        path.with_suffix(suffix).write_bytes(recording.with_suffix(suffix).read_bytes())
    with edited(path) as file:
        for episode in file.values():
            del episode["env_states"]
    with Recording(path) as bare, Recording(recording) as whole:
        played, recorded = episode_cell(bare, 0).motion, episode_cell(whole, 0).motion
    for name in ("left", "right"):
        np.testing.assert_array_equal(played.qpos[name], recorded.qpos[name])


def test_an_episode_that_is_not_there(recording):
    with (
        Recording(recording) as file,
        pytest.raises(TrajectoryError, match="has no episode 2; it has 2, from 0 to 1"),
    ):
        episode_cell(file, 2)


@pytest.mark.long
def test_view_shows_what_it_is_given(recording, tmp_path, capsys):
    cell = rl.face_to_face({"left": "panda", "right": "so100"})
    env = rl.make("PushCube-v1")
    page = tmp_path / "page.html"
    with rl.Recording(recording) as opened:
        for shown, title in {
            cell: "left panda, right so100",
            env: "PushCube-v1",
            recording: "TwoRobotPickCube-v1, episode 1 of trajectory.h5",
            recording.parent: "TwoRobotPickCube-v1, episode 1 of trajectory.h5",
            opened: "TwoRobotPickCube-v1, episode 1 of trajectory.h5",
        }.items():
            rl.view(shown, html=page, episode=1)
            assert f"<title>{title}</title>" in page.read_text(encoding="utf-8")
    env.close()


def test_a_recording_of_another_task(recording, capsys):
    assert main(["view", str(recording), "--task", "PickCube-v1"]) == 1
    assert "was recorded in TwoRobotPickCube-v1, not in PickCube-v1" in capsys.readouterr().err


@pytest.mark.long
def test_tasks_hand_a_demonstration_over(recording):
    words = ("tasks", "view", TWO_ROBOTS, "--demo", str(recording), "--episode", "1")
    with served("robot_layouts", *words, "--port", "0") as view:
        assert view.lines[-1].startswith("TwoRobotPickCube-v1, episode 1 of trajectory.h5: http://")
        code, printed = view.interrupt()
        assert code == 0
        assert printed.endswith("\nended\n")
    words = ("-m", "robot_layouts", "tasks", "view", "PickCube-v1", "--demo", str(recording))
    other = [sys.executable, *words]
    done = subprocess.run(other, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "not in PickCube-v1" in done.stderr


@pytest.mark.long
@pytest.mark.browser
def test_the_timeline_is_scrubbed_and_played(recording, tmp_path):
    words = ("robot_layouts", "view", str(recording), "--episode", "1", "--port", "0")
    with served(*words) as view, browser_page() as (page, _):
        page.goto(view.url)
        page.get_by_text(f"step 0 of {STEPS}, 0.00 s").wait_for()
        start = settled(page, lambda now: changed(now, np.full_like(now, 255)) > 30000)
        page.screenshot(path=tmp_path / "start.png")
        step = page.get_by_role("slider").first
        step.focus()
        step.press("End")
        page.get_by_text(f"step {STEPS} of {STEPS}, 0.30 s").wait_for()
        settled(page, lambda now: changed(now, start) > 100)
        page.screenshot(path=tmp_path / "end.png")
        page.get_by_label("Play").click()
        page.get_by_text(f"step 2 of {STEPS}").wait_for()
