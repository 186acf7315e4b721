"""Policies, takeovers and correctors as sources of recordings, and what is kept of who acted."""

import json
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import torch

import tasks
from robot_layouts.__main__ import main
from robot_layouts.core.processes.start import WorkerError
from robot_layouts.data import evaluate, record
from robot_layouts.data.actors import Actor, actor_of, episode_source
from robot_layouts.data.playing.replay import replay
from robot_layouts.data.reading.json_files import TrajectoryError
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.recorder import Recorder
from robot_layouts.experts import registry
from robots import RecordingError, TaskError
from tasks.episode import play
from tests.data import policies
from tests.data.plays import at_random
from tests.data.policies import TASK, Leans, Wanders, meddles, still
from tests.data.recordings import edited
from tests.data.test_recorder import same_files

FILE = "trajectory.h5"
SOURCE = sha256(Path(policies.__file__).read_bytes()).hexdigest()
WANDERS = {"kind": "policy", "name": "tests.data.policies:Wanders", "sha256": SOURCE}
MEDDLES = {"kind": "policy", "name": "tests.data.policies:meddles", "sha256": SOURCE}


def recorded(folder, **arguments):
    seeds = arguments.pop("seeds", range(3))
    chosen = {"workers": 0, "policy": Wanders(0.5), **arguments}
    summary = record(TASK, seeds, folder, **chosen)
    assert not summary.failed
    with Recording(folder / FILE) as file:
        return list(file)


def test_a_policy_is_recorded_whoever_plays(tmp_path):
    """Worlds at once, processes and resumptions make no difference, whatever it draws."""
    episodes = recorded(tmp_path / "one")
    scores = evaluate(Wanders(0.5), TASK, range(3), workers=0).scores
    assert [float(np.float64(e.rewards).sum()) for e in episodes] == pytest.approx(
        [scores[seed].total for seed in range(3)], rel=1e-12
    )
    for episode in episodes:
        assert replay(env := tasks.make(TASK, obs_mode="none"), episode).difference is None
        assert len(episode.actions) == env.max_episode_steps
        assert episode.source == WANDERS
        assert episode.actor is episode.corrections is None
    recorded(tmp_path / "two", seeds=[2], num_envs=3)
    recorded(tmp_path / "two", num_envs=3)
    assert same_files(tmp_path / "one" / FILE, tmp_path / "two" / FILE)


@pytest.mark.long
def test_processes_make_no_difference(tmp_path):
    both = {"takeover": meddles, "corrector": Leans()}
    recorded(tmp_path / "here", **both)
    recorded(tmp_path / "there", workers=2, num_envs=2, **both)
    assert same_files(tmp_path / "here" / FILE, tmp_path / "there" / FILE)


@pytest.mark.long
def test_a_batched_policy_records_what_it_does_alone(tmp_path):
    recorded(tmp_path / "alone", policy=Leans(batched=False))
    recorded(tmp_path / "at once", policy=Leans(batched=True), num_envs=3)
    assert same_files(tmp_path / "alone" / FILE, tmp_path / "at once" / FILE)


def overlong(task, seed):
    """An expert whose plan goes on when time is over."""
    return np.tile(at_random(task, seed), (6, 1))


@pytest.mark.long
def test_an_expert_is_recorded_as_ever(tmp_path, monkeypatch):
    """To the end of its plan."""
    monkeypatch.setitem(registry.EXPERTS.registered, TASK, overlong)
    for count in (1, 2):
        episodes = recorded(tmp_path / str(count), policy="expert", num_envs=count)
    assert [episode.source for episode in episodes] == [None] * 3
    assert same_files(tmp_path / "1" / FILE, tmp_path / "2" / FILE)
    env = tasks.make(TASK)
    with Recorder(tmp_path / FILE, env, source_desc=f"{__name__}:overlong") as recorder:
        for seed in range(3):
            recorder.add(play(env, seed, overlong(env, seed)))
    assert same_files(tmp_path / "1" / FILE, tmp_path / FILE)


@pytest.mark.long
def test_somebody_takes_over_now_and_then(tmp_path):
    """Each step says who acted, and the policy is the same afterwards: it sees everything."""
    episodes = recorded(tmp_path / "one", takeover=meddles)
    for episode in episodes:
        assert episode.source == {
            "kind": "mixed",
            "name": "tests.data.policies:Wanders, tests.data.policies:meddles",
            "actors": [WANDERS, MEDDLES],
        }
        meddled = (episode.actions == np.float32(0.25)).all(axis=1)
        assert np.array_equal(episode.actor, meddled)
        assert 10 < meddled.sum() < 90
        assert replay(tasks.make(TASK, obs_mode="none"), episode).difference is None
    recorded(tmp_path / "at once", takeover=meddles, num_envs=3)
    assert same_files(tmp_path / "one" / FILE, tmp_path / "at once" / FILE)
    header = json.loads((tmp_path / "one" / "trajectory.json").read_text())
    assert header["source_type"] == "mixed"
    assert header["source_desc"] == ("tests.data.policies:Wanders; tests.data.policies:meddles")


@pytest.mark.long
@pytest.mark.parametrize("batched", [False, True])
def test_a_takeover_that_never_acts_changes_nothing(tmp_path, batched):
    policy = Leans(batched)
    quiet = recorded(tmp_path / "quiet", policy=policy, takeover=policies.quiet, num_envs=3)
    for one, other in zip(recorded(tmp_path / "alone", policy=policy), quiet, strict=True):
        assert one.actions.tobytes() == other.actions.tobytes()
        assert one.source == other.source
        assert other.actor is None


@pytest.mark.long
def test_corrections_name_the_policy_that_they_correct(tmp_path):
    """They stand beside what was carried out, which whoever took over may have done."""
    both = {"takeover": meddles, "corrector": "tests.data.policies:LEANS"}
    for episode in recorded(tmp_path / "one", **both):
        leans = {"kind": "correction", "name": "tests.data.policies:LEANS", "sha256": SOURCE}
        assert episode.source == {**leans, "corrects": WANDERS, "actors": [WANDERS, MEDDLES]}
        env = tasks.make(TASK)
        observation, _ = env.reset(episode.seed, options={"reconfigure": True})
        for action, correction in zip(episode.actions, episode.corrections, strict=True):
            assert np.array_equal(correction, Leans()(observation)[0])
            observation, *_ = env.step(action)
    recorded(tmp_path / "at once", num_envs=2, **both)
    assert same_files(tmp_path / "one" / FILE, tmp_path / "at once" / FILE)


@pytest.mark.long
def test_several_sources_in_one_data_set(tmp_path, monkeypatch, capsys):
    """In whichever order they come, and each episode says who acted."""
    monkeypatch.setitem(registry.EXPERTS.registered, TASK, at_random)
    sources = {
        "expert": {"seeds": [0, 4]},
        "policy": {"policy": Wanders(0.5), "seeds": [1], "takeover": meddles},
        "correction": {"policy": still, "seeds": [2], "corrector": Leans()},
    }
    for name, order in (("there", [0, 1, 2]), ("back", [2, 1, 0])):
        for source in (list(sources.values())[i] for i in order):
            record(TASK, source["seeds"], tmp_path / name, workers=0, **_without_seeds(source))
        record(TASK, [0], tmp_path / name, workers=0, policy=policies.quiet)  # there already
    assert same_files(tmp_path / "there" / FILE, tmp_path / "back" / FILE)
    header = json.loads((tmp_path / "there" / "trajectory.json").read_text())
    assert header["source_type"] == "mixed"
    names = ("plays:at_random", "policies:Leans", "policies:Wanders", "policies:meddles")
    assert header["source_desc"] == "; ".join(
        f"tests.data.{name}" for name in (*names, "policies:still")
    )
    with Recording(tmp_path / "there" / FILE) as file:
        kinds = [(episode.source or {}).get("kind") for episode in file]
    assert kinds == [None, "mixed", "correction", None]
    assert main(["replay", str(tmp_path / "there")]) == 0
    assert "in 4 all states are equal to the last bit" in capsys.readouterr().out


def _without_seeds(source):
    return {name: value for name, value in source.items() if name != "seeds"}


def test_what_was_left_by_a_killed_recording_keeps_its_source(tmp_path):
    """Its parts say who played them, and the file says so when another policy goes on."""
    env = tasks.make(TASK)
    episode = play(env, 7, np.zeros((3, 7), np.float32))
    with Recorder(tmp_path / FILE, env, source="human", source_desc="browser") as recorder:
        part = recorder.encoder.encode(replace(episode, source={"kind": "person", "name": "me"}))
    (tmp_path / FILE).unlink()
    (tmp_path / "trajectory.parts").mkdir()
    (tmp_path / "trajectory.parts" / "seed-0000000007.part").write_bytes(part)
    first, last = recorded(tmp_path, policy=still, seeds=[1])
    assert (first.source["name"], last.source["name"]) == ("tests.data.policies:still", "me")
    header = json.loads((tmp_path / "trajectory.json").read_text())
    assert (header["source_type"], header["source_desc"]) == (
        "mixed",
        "browser; tests.data.policies:still",
    )


@pytest.mark.long
def test_one_that_fails_does_not_cost_the_others(tmp_path):
    summary = record(TASK, range(6), tmp_path, workers=0, policy=policies.fails_at_times)
    failed = {seed: str(error) for seed, error in summary.failed.items()}
    assert 0 < len(failed) < 6
    assert all("ValueError: not this one" in words for words in failed.values())
    again = record(
        TASK, range(6), tmp_path / "more", workers=0, policy=policies.fails_at_times, num_envs=4
    )
    assert {seed: str(error) for seed, error in again.failed.items()} == failed
    assert isinstance(next(iter(again.failed.values())), WorkerError)
    assert same_files(tmp_path / FILE, tmp_path / "more" / FILE)


@pytest.mark.long
def test_one_that_ends_its_workers_does_not_cost_the_others(tmp_path):
    rare, died = policies.fails_at_times, policies.dies_at_times
    failed = record(TASK, range(6), tmp_path / "rare", workers=0, policy=rare).failed
    summary = record(TASK, range(6), tmp_path, workers=2, policy=died)
    assert summary.failed.keys() == failed.keys()
    assert len(summary.deaths) == 3 * len(failed)
    for seed, error in summary.failed.items():
        assert f"the episode of seed {seed} ended 3 worker processes; the last" in str(error)
    with Recording(tmp_path / FILE) as file:
        assert file.seeds == tuple(seed for seed in range(6) if seed not in failed)
    again = record(TASK, range(6), tmp_path, workers=2, policy=died)  # it is tried again
    assert again.failed.keys() == failed.keys()
    assert again.already == 6 - len(failed)


@pytest.mark.long
def test_a_policy_that_ends_all_workers_ends_the_recording(tmp_path, monkeypatch):
    monkeypatch.setattr("robot_layouts.data.recording.record.LOST_IN_A_ROW", 2)
    with pytest.raises(WorkerError, match="seed 1 ended 3 worker processes; .* SIGKILL"):
        record(TASK, range(100), tmp_path, workers=1, policy=policies.dies)


class Hand:
    """A person, whom nobody copies."""

    actor = Actor("person", "gamepad")

    def __call__(self, obs):
        return np.zeros(7, np.float32)

    def __deepcopy__(self, memo):
        raise AssertionError


def test_a_person_takes_over_for_good(tmp_path):
    (episode,) = recorded(tmp_path, takeover=Hand(), seeds=[0])
    assert episode.source == {"kind": "person", "name": "gamepad"}
    assert episode.actor is None
    assert (episode.actions == 0).all()
    assert json.loads((tmp_path / "trajectory.json").read_text())["source_desc"] == (
        "gamepad; tests.data.policies:Wanders"
    )


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"policy": lambda obs: torch.zeros(1, 6)}, r"the action has shape \(1, 6\); it must be"),
        ({"takeover": lambda obs: "left"}, "of the takeover: the action has dtype <U4; it must"),
        ({"takeover": lambda obs: np.full(7, np.nan)}, "of the takeover: action number 0 is nan"),
        ({"policy": partial(policies.too_few, 0)}, "returned 0 actions for 2 observations"),
    ],
)
def test_what_is_no_action(tmp_path, given, words):
    if isinstance(given.get("policy"), partial):
        given["policy"].batched = True
    chosen = {"policy": still, **given}
    summary = record(TASK, [3, 4], tmp_path, workers=0, num_envs=2, **chosen)
    assert list(summary.failed) == [3, 4]
    for error in summary.failed.values():
        with pytest.raises(Exception, match=words):
            raise error
    assert summary.recorded == 0


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"policy": "exprt"}, "policy is 'exprt'; it must be MODULE:NAME, ws://HOST:PORT, hub:"),
        ({"policy": Wanders}, r"policy is the class Wanders; give an instance of it, .* Wanders()"),
        ({"policy": "tests.data.policies:stil"}, "has no attribute 'stil'. Did you mean 'stil"),
        ({"policy": "tasks:policy"}, "no attribute 'policy'; 'tasks' is a package of this library"),
        ({"policy": still, "takeover": "expert"}, "takeover is 'expert'; it must be MODULE:NAME"),
        ({"takeover": still}, "an expert's plan is made for what it does itself; a takeover or"),
        ({"policy": still, "obs_mode": "stat"}, "unknown obs_mode 'stat'. Did you mean 'state'"),
    ],
)
def test_bad_arguments_leave_nothing_behind(tmp_path, given, words):
    with pytest.raises(TaskError, match=words):
        record(TASK, [0], tmp_path / "never", workers=0, **given)
    assert not (tmp_path / "never").exists()


def test_the_command_records_a_policy(tmp_path, capsys):
    words = ["record", f"--task={TASK}", "--episodes=2", "--workers=0", "--num-envs=2"]
    names = ("policy", "still"), ("takeover", "meddles"), ("corrector", "LEANS")
    words += [f"--{what}=tests.data.policies:{name}" for what, name in names]
    assert main([*words, f"--out={tmp_path}", "--obs-mode=state"]) == 0
    assert "2 new episodes" in capsys.readouterr().out
    with Recording(tmp_path / FILE) as file:
        assert [actor["name"].partition(":")[2] for actor in file[0].source["actors"]] == [
            "still",
            "meddles",
        ]
        assert file[0].corrections.shape == file[0].actions.shape
    assert main([*words, f"--out={tmp_path / 'x'}", "--policy=no.such:thing"]) == 1
    assert "error: no policy 'no.such:thing': ModuleNotFoundError" in capsys.readouterr().err


def test_who_somebody_is(tmp_path):
    assert actor_of(partial(partial(still), 3)).name == "tests.data.policies:still"
    assert actor_of(Wanders(0.5)) == Actor(**WANDERS)
    assert actor_of(len) == Actor("policy", "builtins:len")
    weights = tmp_path / "weights.pt"
    weights.write_bytes(b"1" * 2**21)
    policy = Wanders()
    policy.file = weights
    assert actor_of(policy, "mine:best").to_json() == {
        "kind": "policy",
        "name": "mine:best",
        "sha256": sha256(b"1" * 2**21).hexdigest(),
    }
    policy.file = tmp_path / "gone.pt"
    with pytest.raises(RecordingError, match="gone.pt'.* of the policy .*Wanders cannot be read"):
        actor_of(policy)
    policy.actor = Actor("person", "browser")
    assert actor_of(policy) == Actor("person", "browser")


def test_who_acted_out_of_three():
    people = [Actor("policy", "p"), Actor("person", "a"), Actor("person", "b")]
    turns = np.array([2, 0, 2], np.uint8)
    source, actor = episode_source(people, turns)
    assert source["actors"] == [{"kind": "policy", "name": "p"}, {"kind": "person", "name": "b"}]
    assert actor.tolist() == [1, 0, 1]
    assert actor.dtype == np.uint8
    assert episode_source(people, np.full(3, 1, np.uint8)) == (
        {"kind": "person", "name": "a"},
        None,
    )


@pytest.mark.parametrize(
    ("name", "rows", "words"),
    [
        ("actor", np.full(100, 2, np.uint8), "its actor is not at each step one of the 2 of its"),
        ("actor", np.zeros(100, np.float32), "its actor is not at each step one of the 2 of its"),
        ("actor", np.zeros(99, np.uint8), r"actor has shape \(99,\), not \(100,\)"),
        ("corrections", np.zeros((100, 6), np.float32), r"corrections has shape \(100, 6\), not"),
        ("corrections", np.full((100, 7), np.nan, np.float32), "its corrections are not all fini"),
    ],
)
def test_a_file_that_says_nonsense(mixed, tmp_path, name, rows, words):
    for file in mixed.iterdir():
        (tmp_path / file.name).write_bytes(file.read_bytes())
    with edited(tmp_path / FILE) as file:
        file["traj_0"].pop(name, None)
        file[f"traj_0/{name}"] = rows
    with Recording(tmp_path / FILE) as file, pytest.raises(TrajectoryError, match=words):
        _ = file[0]


@pytest.fixture(scope="module")
def mixed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mixed")
    recorded(folder, seeds=[0], takeover=meddles)
    return folder
