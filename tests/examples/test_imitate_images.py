"""The example that learns from what cameras see."""

import json
import pickle
from contextlib import closing
from dataclasses import replace
from shutil import copytree

import h5py
import pytest
import torch

pytest.importorskip("matplotlib")

import tasks
from robot_layouts.data import evaluate, record
from robot_layouts.data.reading.recording import Recording
from robots import TaskError
from tests.examples.learning import examples, finish, start

__all__ = ["examples"]

TASK = "PushCube-v1"
WORDS = [TASK, "--episodes", "2", "--steps", "25", "--examined", "1", "--tests", "1"]

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


def test_it_records_draws_learns_and_leaves_its_files(learned):
    names = {"learning_curve.json", "learning_curve.png", "policy.pt", "recording", "pictures"}
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
    assert seen.pictures.shape == (1, 3, 96, 96)


def test_pictures_of_another_recording_are_refused(example, learned, tmp_path, capsys):
    copytree(learned / "pictures", tmp_path / "pictures")
    from imitate import shaking

    shaken = shaking(example.PictureRecipe(TASK))
    record(TASK, range(5, 7), tmp_path / "recording", workers=0, randomization=shaken)
    other = ["--recording", str(tmp_path / "recording"), "--workers", "0"]
    assert example.run([*WORDS, *other, "--out", str(tmp_path)]) == 1
    assert "image.hdf5 has other episodes than" in capsys.readouterr().err
    assert not (tmp_path / "policy.pt").exists()


def test_more_pictures_than_wanted_serve_but_not_fewer_or_smaller(example, learned, tmp_path):
    file = copytree(learned / "pictures", tmp_path / "pictures") / "image.hdf5"
    recipe, recording = example.PictureRecipe(TASK, episodes=2), learned / "recording"
    columns = example.RobotSenses(recipe).columns
    one = example.load_pictures(file, recording, replace(recipe, episodes=1), columns)
    both = example.load_pictures(file, recording, recipe, columns)
    assert torch.equal(one, both[: len(one)])
    assert len(one) < len(both)
    with pytest.raises(TaskError, match="not 64 wide; remove it, or choose another folder"):
        example.load_pictures(file, recording, replace(recipe, size=64), columns)
    with h5py.File(file, "a") as dataset:
        del dataset["data/demo_1"]
    with pytest.raises(TaskError, match="other episodes"):
        example.load_pictures(file, recording, recipe, columns)


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


def test_what_it_does_depends_on_what_it_sees(example, learned):
    policy = example.SeeingPolicy.load(learned / "policy.pt")
    env = tasks.make(TASK, **policy.making)
    with closing(env):
        sights = policy.sense(env.reset(seed=0)[0])
    other = example.Sights(sights.numbers, sights.pictures.flip(3))
    with torch.no_grad():
        assert not torch.equal(policy._network(sights), policy._network(other))


@pytest.mark.parametrize("size", [8, 33, 96])
def test_pictures_may_be_of_any_size(example, size):
    eye = example.Eye(3, size)
    pictures = torch.zeros(2, 3, size, size, dtype=torch.uint8)
    assert eye(pictures).shape == (2, example.SEEN)


def test_the_policy_plays_alike_alone_and_beside_others(example, learned):
    policy = example.SeeingPolicy.load(learned / "policy.pt")
    alone = evaluate(policy, TASK, range(50, 52), workers=0, **policy.making)
    copy = pickle.loads(pickle.dumps(policy))
    beside = evaluate(copy, TASK, range(50, 52), workers=0, num_envs=2, **policy.making)
    assert alone.scores == beside.scores
