"""The example that learns from what cameras see."""

import json
from contextlib import closing

import pytest
import torch

pytest.importorskip("matplotlib")

import tasks
from robot_layouts.__main__ import main
from robot_layouts.data import record
from robot_layouts.data.reading.recording import Recording
from robots import TaskError
from tests.examples.learning import examples, finish, start

__all__ = ["examples"]

TASK = "PushCube-v1"
WORDS = [TASK, "--episodes", "2", "--steps", "25", "--examined", "1", "--tests", "1"]
WORDS += ["--size", "32"]

pytestmark = pytest.mark.long  # they record and learn


@pytest.fixture
def example(examples, renderer):
    if renderer is None:
        pytest.skip("there is no Vulkan driver to draw pictures with")
    import imitate_images

    return imitate_images


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A folder for a run that nothing interrupts; later tests find its files."""
    return tmp_path_factory.mktemp("learned")


@pytest.fixture
def learned(example, kept):
    """The folder of that run."""
    if not (kept / "learning_curve.json").exists():
        assert example.run([*WORDS, "--workers", "0", "--out", str(kept)]) in (0, 1)
    return kept


def test_it_records_learns_and_leaves_its_files(learned):
    names = {"learning_curve.json", "learning_curve.png", "policy.pt", "recording"}
    assert {path.name for path in learned.iterdir()} == names
    curve = json.loads((learned / "learning_curve.json").read_text())["curve"]
    assert [point["steps"] for point in curve] == [5, 10, 15, 20, 25]
    assert curve[-1]["error"] < curve[0]["error"]


def test_another_run_has_the_same_weights(example, learned, tmp_path):
    words = [*WORDS, "--recording", str(learned / "recording"), "--workers", "2"]
    finish(start("imitate_images", tmp_path, *words))
    assert (tmp_path / "policy.pt").read_bytes() == (learned / "policy.pt").read_bytes()


def test_what_it_learned_from_is_what_it_gets_when_it_plays(example, learned):
    policy = example.SeeingPolicy.load(learned / "policy.pt")
    training = policy.training(policy.recipe, learned / "recording", 0, learned)
    sights = training._observations
    env = tasks.make(TASK, **policy.making)
    with closing(env), Recording(learned / "recording") as recording:
        first = 0
        for episode in recording:
            observation, _ = env.reset(seed=episode.seed, options={"reconfigure": True})
            seen, then = policy.sense(observation), sights[torch.tensor([first])]
            assert torch.equal(seen.numbers, then.numbers)
            assert torch.equal(seen.pictures, then.pictures)
            first += len(episode.actions)
    assert first == len(sights.pictures) == len(sights.numbers)
    assert seen.pictures.shape == (1, 3, 32, 32)


def test_a_recording_without_pictures_or_with_others_is_refused(example, learned, tmp_path):
    recipe = example.PictureRecipe(TASK, episodes=1)
    with pytest.raises(TaskError, match="has pictures that are not 96 wide"):
        example.load_pictures(learned / "recording", recipe)
    record(TASK, [0], tmp_path, workers=0)
    with pytest.raises(TaskError, match="holds no pictures; choose another folder"):
        example.load_pictures(tmp_path, recipe)


def test_a_receipt_of_what_was_learned_is_verified_with_its_pictures(
    example, learned, tmp_path, monkeypatch
):
    monkeypatch.setenv("IMITATE_IMAGES_POLICY", str(learned / "policy.pt"))
    receipt, policy = str(tmp_path / "receipt.json"), ["--policy", "imitate_images:policy"]
    words = ["--task", TASK, "--episodes", "2", "--obs-mode", "rgb", "--camera-size", "32x32"]
    words += ["--control-mode", "pd_joint_pos", "--workers", "0", "--receipt", receipt]
    assert main(["evaluate", *policy, *words]) == 0
    episodes = json.loads((tmp_path / "receipt.json").read_text())["episodes"]
    assert all("base_camera/rgb" in episode["pictures"] for episode in episodes)
    assert main(["verify", receipt, *policy, "--num-envs", "2", "--workers", "0"]) == 0


def test_it_is_not_told_where_objects_are(example, learned):
    senses = example.RobotSenses(example.PictureRecipe(TASK))
    env = tasks.make(TASK, obs_mode="state_dict")
    with closing(env):
        observation, _ = env.reset(seed=0)
    before = senses(observation)
    observation["extra"]["obj_pose"] += 1
    assert torch.equal(senses(observation), before)
    observation["agent"]["qpos"] += 1
    assert not torch.equal(senses(observation), before)
