"""A task, its expert and a variant in a package of a user's own: every command takes them."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from robot_layouts.data.reading.recording import Recording
from tests.data.clusters import running_cluster
from tests.outside.lab import CHECKOUT, PACKAGE, TRAY, add_metadata, make_folder, row, run, words

RECORD = f"record {words(task=TRAY, out='data', episodes=2)}"


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """A folder with the package, where other files are called like packages of ours."""
    return make_folder(tmp_path_factory.mktemp("lab"), shadows=True)


@pytest.fixture(scope="module")
def recorded(lab):
    """The same after the commands that name module and id; with what they printed."""
    codes, printed = run(lab, "tasks list mylab.tray", f"{RECORD} --workers 0", "replay data")
    assert codes == [0] * len(codes), printed
    return lab, printed


def test_commands_take_a_module_and_an_id(recorded):
    _, printed = recorded
    assert row(printed, "TwoArmTray-v1")[-1] == "mylab.tray"
    assert row(printed, "PickCube-v1")[-1] == "robot-layouts"
    assert "2 of 2 episodes end as recorded; in 2 all states are equal" in printed


@pytest.mark.long
def test_every_other_command_takes_them_too(recorded):
    lab, _ = recorded
    codes, printed = run(
        lab,
        f"tasks describe {TRAY} --robots right=panda_wristcam",
        f"{RECORD} --workers 1",
        f"evaluate {words(task=TRAY, episodes=1, workers=0)}",
        f"export data/trajectory.h5 {words(format='robomimic', out='set')}",
    )
    assert codes == [0] * len(codes), printed
    assert "1 × panda" not in printed
    assert "panda_wristcam" in printed
    assert f"other names {TRAY}" in " ".join(printed.split())
    assert "2 of 2 episodes were recorded before" in printed
    assert "TwoArmTray-v1, expert: 1 of 1 episodes with success" in printed
    assert list((lab / "set").iterdir())


@pytest.mark.long
def test_a_recording_does_not_choose_which_code_runs(recorded):
    lab, _ = recorded
    (code, *codes), printed = run(lab, "replay data", f"replay data --task {TRAY}", "replay data")
    assert code == 1
    assert "was recorded in TwoArmTray-v1 of the module mylab.tray" in printed
    assert f"name it: --task {TRAY}" in printed
    assert codes == [0, 0]  # once it is named, this process knows it


@pytest.mark.long
def test_an_installed_package_needs_no_module(recorded, tmp_path):
    lab, _ = recorded
    there = make_folder(tmp_path)
    add_metadata(there)
    codes, printed = run(
        there,
        "tasks list",
        f"replay {lab / 'data'}",
        f"export {lab / 'data' / 'trajectory.h5'} {words(format='robomimic', out='set')}",
        "layouts show around_a_tray a=panda b=ur5 c=so100",
        "evaluate --task ThreeArmTray-v1 --episodes 1 --workers 0",
        installed=True,
    )
    assert codes == [0] * 5, printed
    assert row(printed, "ThreeArmTray-v1")[-2:] == ["mylab", "1.0"]
    assert "ThreeArmTray-v1, expert: 1 of 1 episodes with success" in printed


@pytest.mark.long
def test_every_front_takes_a_module_and_an_id(lab):
    code = (
        "import gymnasium, tasks\n"
        "if __name__ == '__main__':\n"
        f"    print(gymnasium.make({TRAY!r}).action_space.shape)\n"
        f"    vec = gymnasium.make_vec({TRAY!r}, num_envs=2, num_workers=1)\n"
        "    print(vec.reset(seed=0)[0].shape)\n"
        "    vec.close()\n"
        f"    print(tasks.parallel_env({TRAY!r}).possible_agents)\n"
        f"    print(tasks.sb3_vec_env({TRAY!r}, 1, num_workers=0).reset().shape)\n"
    )
    (lab / "bin" / "fronts.py").write_text(code)
    done = subprocess.run(
        [sys.executable, lab / "bin" / "fronts.py"],
        env={**os.environ, "PYTHONPATH": f"{PACKAGE}{os.pathsep}{CHECKOUT}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.splitlines() == ["(16,)", "(2, 49)", "['left', 'right']", "(1, 49)"], done


@pytest.mark.long
def test_a_recording_that_is_killed_goes_on(tmp_path):
    lab = make_folder(tmp_path)
    line = f"record {words(task=TRAY, out='data', episodes=8, workers=2)}"
    process = subprocess.Popen(
        [sys.executable, lab / "bin" / "several", line],
        cwd=lab,
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
        start_new_session=True,
    )
    deadline = time.monotonic() + 120
    while len(list((lab / "data").glob("*.parts/*.part"))) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    codes, printed = run(lab, line, f"replay data --task {TRAY}")
    assert codes == [0, 0], printed
    assert "episodes were recorded before" in printed
    with Recording(lab / "data" / "trajectory.h5") as file:
        assert sorted(file.seeds) == list(range(8))
        assert file.module == "mylab.tray"


@pytest.mark.long
@pytest.mark.parametrize("task", [TRAY, "ThreeArmTray-v1"])
def test_ray(tmp_path, task):
    lab = make_folder(tmp_path)
    add_metadata(lab)
    with running_cluster() as nodes:
        nodes.grow(2)
        done = subprocess.run(
            [
                *(sys.executable, str(lab / "bin" / "several")),
                f"record {words(task=task, out='data', episodes=4, ray=nodes.address)}",
                f"replay data --task {task}",
            ],
            cwd=lab,
            env={**os.environ, "PYTHONPATH": f"{lab}{os.pathsep}{CHECKOUT}"},
            capture_output=True,
            text=True,
            check=False,
        )
    assert done.stdout.count("exit 0") == 2, done.stdout + done.stderr


@pytest.mark.long
def test_the_wheels_in_an_empty_environment(tmp_path):
    environment, wheels = tmp_path / "venv", tmp_path / "wheels"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment], check=True)
    for project in (CHECKOUT, PACKAGE):
        build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory"]
        subprocess.run([*build, str(wheels)], cwd=project, check=True, capture_output=True)
    python = environment / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps"]
    subprocess.run([*pip, "--no-index", *wheels.glob("*.whl")], check=True, capture_output=True)
    home = Path(
        subprocess.check_output(
            [python, "-c", "import sysconfig as s; print(s.get_path('purelib'))"], text=True
        ).strip()
    )  # noqa: E501
    others = [path for path in sys.path if path.endswith("-packages")]
    (home / "others.pth").write_text("\n".join(others))  # what both depend on, and no checkout
    folder = tmp_path / "folder"
    (folder / "tasks").mkdir(parents=True)
    (folder / "tasks" / "__init__.py").write_text("")
    assets = os.environ.get("ROBOT_LAYOUTS_ASSETS", str(CHECKOUT / "assets_cache"))
    variables = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}

    def script(*arguments: str) -> str:
        done = subprocess.run(
            [environment / "bin" / "robot-layouts", *arguments],
            cwd=folder,
            env={**variables, "ROBOT_LAYOUTS_ASSETS": assets, "COLUMNS": "200"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    assert row(script("tasks", "list"), "TwoArmTray-v1")[-2:] == ["mylab", "1.0"]
    task = ["--task", "TwoArmTray-v1", "--episodes", "2"]
    script("record", *task, "--workers", "2", "--out", "data")
    assert "in 2 all states are equal" in script("replay", "data")
    assert "2 of 2 episodes with success" in script("evaluate", *task, "--workers", "1")
    script("tasks", "describe", TRAY)
    script("tasks", "view", TRAY, "--html", "tray.html")
    script("view", "data", "--html", "episode.html")
    script("export", "data/trajectory.h5", "--format", "robomimic", "--out", "set")
