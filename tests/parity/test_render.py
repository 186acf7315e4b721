"""``python -m parity render``: what it writes, what it prints, and what it refuses."""

import json
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest

import tasks
from parity.__main__ import main
from parity.compare.both_sides import OurSide
from parity.compare.episodes import random_episodes
from parity.show.clip import Candidate, Clip, ClipOptions, choose
from parity.show.side_by_side import HONEST
from robots import RobotRegistry
from tests.native import NATIVE
from tests.parity.test_command import run_alone
from tests.parity.test_episodes import demonstration
from tests.parity.test_mutants import with_arm
from tests.parity.test_pictures import SIZE, native

STEPS = 5

RENDER = (
    "import sys; from parity.__main__ import main;"
    "sys.exit(main(['render', '--task', 'TwoRobotPickCube-v1', '--out', sys.argv[1]]))"
)


def run(*arguments: object) -> int:
    try:
        return main(["render", *map(str, arguments)])
    except SystemExit as stop:  # argparse
        return stop.code


def recorded(path: Path, seeds: tuple[int, ...] = (4, 2)) -> Path:
    """Write random actions for PickCube, one step fewer in each further episode."""
    episodes = random_episodes(seeds, STEPS, 8)
    actions = {f"a{i}": e.actions[: STEPS - i] for i, e in enumerate(episodes)}
    np.savez(path, seeds=seeds, **actions)
    return path


def panels(clip: Path) -> np.ndarray:
    """Return the frames of a clip without labels: (T, 3, S, S, 3)."""
    frames = imageio.imread(clip)[:, -SIZE:]
    return np.stack([frames[:, :, left : left + SIZE] for left in (0, SIZE + 16, 2 * SIZE + 32)], 1)


@pytest.mark.long
class TestRendering:
    pytestmark = [*NATIVE, pytest.mark.usefixtures("renderer")]

    @pytest.mark.long
    def test_a_clip_of_equal_sides(self, tmp_path, capsys):
        demo = recorded(tmp_path / "wild.npz")
        code = run(
            *("--task", "PickCube-v1", "--demo", demo, "--out", tmp_path, "--size", SIZE),
            *("--rank-by", "agreement"),
        )
        printed = capsys.readouterr().out
        assert code == 1, "random actions do not succeed"
        folder = tmp_path / "PickCube-v1"
        assert {path.name for path in folder.iterdir()} == {
            f"side_by_side.{ending}" for ending in ("mp4", "png", "json")
        }
        found = json.loads((folder / "side_by_side.json").read_text())
        expect_equal(found)
        assert found["seed"] == 2, "the shortest of those that are equally alike"
        assert found["source"] == f"{tmp_path.name}/wild episode 1"
        assert "success: neither" in printed
        assert "states: largest difference 0 over 4 steps" in printed
        assert "mean difference 0.0000 of 255, 0 of 5 frames differ" in printed
        assert str(folder / "side_by_side.mp4") in printed
        theirs, ours, delta = panels(folder / "side_by_side.mp4").swapaxes(0, 1)
        assert len(theirs) == 5
        assert theirs.std() > 20, "there is something to see"
        assert np.abs(theirs.astype(int) - ours).mean() < 2, "h264 is not exact"
        assert delta.max() < 8
        assert imageio.imread(folder / "side_by_side.png").shape[2] == 3

    @pytest.mark.long
    def test_a_file_in_joint_positions(self, tmp_path):
        demo = demonstration(tmp_path / "planned", control_mode="pd_joint_pos")
        out = ("--out", tmp_path, "--size", SIZE, "--truncate-buffer", -1, "--seed", 41)
        assert run("--task", "maniskill.pick_cube_native", "--demo", demo, *out) == 1
        found = json.loads((tmp_path / "PickCube-v1" / "side_by_side.json").read_text())
        expect_equal(found)
        assert (found["seed"], found["source"]) == (41, "planned/trajectory episode 1")

    @pytest.mark.long
    def test_a_clip_of_sides_that_differ(self, tmp_path):
        """Our side begins the episode of another seed: every frame differs, and it is told."""
        ours = OtherSeed(tasks.make("PickCube-v1"))
        (episode,) = random_episodes([4], STEPS, 8)
        made = Clip(
            native("PickCube-v1"), ours, Candidate(episode, "random"), ClipOptions(gain=4)
        ).write(tmp_path)
        assert not made.verified
        assert made.differing_frames == made.frames == STEPS + 1
        assert made.max_state_difference > 1e-3
        assert made.mean_pixel_difference > 0.05
        delta = panels(tmp_path / "side_by_side.mp4")[:, 2]
        assert (delta.reshape(len(delta), -1).max(1) > 100).all()
        mean = delta.mean() / 4
        assert mean == pytest.approx(made.mean_pixel_difference, rel=0.5), "amplified four times"

    def test_drives_stiffer_by_a_hundredth_are_seen(self, tmp_path):
        stiffer = with_arm(RobotRegistry.load("panda"), stiffness=1010.0)
        ours = OurSide(tasks.make("PickCube-v1", robots={"arm": stiffer}))
        (episode,) = random_episodes([4], 2 * STEPS, 8)
        made = Clip(native("PickCube-v1"), ours, Candidate(episode, "random")).write(tmp_path)
        assert made.max_state_difference > 0
        assert 0 < made.differing_frames < made.frames, "the reset's frame is the same"
        assert not made.verified

    def test_choosing(self):
        """The candidate is chosen in which both sides are the same."""

        class OddSeeds(OtherSeed):
            def begins(self, seed: int) -> int:
                return seed + seed % 2

        ours = OddSeeds(tasks.make("PickCube-v1"))
        candidates = [Candidate(e, "random") for e in random_episodes([1, 4, 3], 2, 8)]
        steps: list[None] = []
        chosen = choose(native("PickCube-v1"), ours, candidates, 10, lambda: steps.append(None))
        assert chosen is candidates[1]
        assert len(steps) == 6

    @pytest.mark.long
    def test_an_expert_succeeds_on_both_sides(self, tmp_path):
        code = run("--task", "TwoRobotPickCube-v1", "--out", tmp_path, "--size", SIZE)
        assert code == 0
        folder = tmp_path / "TwoRobotPickCube-v1"
        found = json.loads((folder / "side_by_side.json").read_text())
        assert found["source"] == "the expert"
        assert found["native_success"] is found["our_success"] is True
        assert found["max_state_difference"] == found["mean_pixel_difference"] == 0.0
        assert found["frames"] <= found["success_step"] + 11

    def test_a_folder_that_cannot_be_written(self, tmp_path, capsys):
        (tmp_path / "PickCube-v1").write_text("in the way")
        demo = recorded(tmp_path / "wild.npz")
        assert run("--task", "PickCube-v1", "--demo", demo, "--out", tmp_path) == 2
        assert f"error: cannot write to {tmp_path / 'PickCube-v1'}" in capsys.readouterr().err

    @pytest.mark.long
    def test_without_a_vulkan_driver(self, tmp_path):
        nowhere = {"VK_DRIVER_FILES": "/nowhere.json", "VK_ICD_FILENAMES": "/nowhere.json"}
        done = run_alone(RENDER.replace("sys.argv[1]", repr(str(tmp_path))), **nowhere)
        assert done.returncode == 2
        last = done.stderr.splitlines()[-1]  # SAPIEN's renderer has its say before
        assert last.startswith("error: native ManiSkill builds no scene without a Vulkan driver")
        assert not list(tmp_path.iterdir())


class OtherSeed(OurSide):
    """A side that is wrong about where an episode begins."""

    def begins(self, seed: int) -> int:
        return seed + 1

    def reset(self, seeds, env_ids, *, rebuild):
        return super().reset([self.begins(seed) for seed in seeds], env_ids, rebuild=rebuild)


def expect_equal(found: dict) -> None:
    assert (found["task"], found["steps"], found["frames"]) == ("PickCube-v1", 4, 5)
    assert found["native_success"] is found["our_success"] is False
    assert found["success_step"] is None
    for key in ("max_state_difference", "differing_frames", "mean_pixel_difference"):
        assert found[key] == 0
    assert found["max_pixel_difference"] == 0
    assert 0 <= found["live_difference"] <= HONEST
    assert (found["panel_size"], found["difference_gain"]) == (SIZE, 8.0)
    assert (found["clip"], found["sheet"]) == ("side_by_side.mp4", "side_by_side.png")


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--task", "PikCube-v1"], "unknown task 'PikCube-v1'. Did you mean 'PickCube-v1'?"),
        (["--demo", "nofile.h5"], "the following arguments are required: --task"),
        (["--task", "PickCube-v1", "--size", "100"], "--size is 100; it must be a multiple of 16"),
        (["--task", "PickCube-v1", "--diff-gain", "0"], "--diff-gain is 0; it must be above 0"),
        (["--task", "PickCube-v1", "--truncate-buffer", "-2"], "--truncate-buffer is -2"),
        (["--task", "PickCube-v1", "--episodes", "3"], "give --rank-by agreement too"),
        (
            ["--task", "PickCube-v1", "--rank-by", "agreement", "--episodes", "0"],
            "--episodes is 0; it must be 1 or more",
        ),
        (["--task", "PickCube-v1", "--rank-by", "luck"], "invalid choice: 'luck'"),
        (["--task", "PickCube-v1", "--seed", "-3"], "--seed is -3; it must be 0 or more"),
    ],
)
def test_bad_usage(arguments, complaint, capsys):
    assert run(*arguments) == 2
    captured = capsys.readouterr()
    assert complaint in captured.err
    assert captured.out == ""


class TestFiles:
    def test_no_such_file(self, capsys, tmp_path):
        recorded(tmp_path / "wild.npz")
        assert run("--task", "PickCube-v1", "--demo", tmp_path / "wlid.npz") == 2
        assert f"did you mean {tmp_path / 'wild.npz'}?" in capsys.readouterr().err

    def test_no_such_seed(self, capsys, tmp_path):
        demo = recorded(tmp_path / "wild.npz")
        assert run("--task", "PickCube-v1", "--demo", demo, "--seed", 3) == 2
        assert "has no episode of seed 3; its seeds: 4, 2" in capsys.readouterr().err

    def test_another_task(self, capsys, tmp_path):
        demo = recorded(tmp_path / "wild.npz")
        assert run("--task", "PushT-v1", "--demo", demo) == 2
        assert "not (T, 7)" in capsys.readouterr().err


@pytest.mark.long
def test_without_imageio(tmp_path):
    """As on a machine without it: it cannot be found nor imported."""
    code = (
        "import importlib.util as u, sys; find = u.find_spec\n"
        "u.find_spec = lambda name, *a: None if name == 'imageio' else find(name, *a)\n"
        "sys.modules['imageio'] = None\n"
    )
    done = run_alone(code + RENDER.replace("sys.argv[1]", repr(str(tmp_path))))
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("error: ")
    assert "imageio not installed; pip install 'robot-layouts[video]'" in done.stderr
    assert not list(tmp_path.iterdir())
