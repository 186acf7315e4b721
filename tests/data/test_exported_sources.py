"""Exports and converted recordings carry who acted."""

import json
from dataclasses import dataclass

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from numpy.typing import NDArray

import tasks
from robot_layouts.data import record
from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.convert import convert
from robot_layouts.experts import find_expert, registry
from tests.data.plays import at_random
from tests.data.policies import TASK, Leans, meddles, still
from tests.data.recordings import edited

FILE = "trajectory.h5"


def saved(folder, form):
    """The dataset of a recording, by episode: actor, corrections, source; and all actors."""
    out = folder / form
    export(
        Export(
            folder / FILE, form, out, fps=20 if form == "lerobot" else None, include_failures=True
        )
    )
    if form == "robomimic":
        with h5py.File(out / "low_dim.hdf5") as file:
            demos = [
                {
                    **{name: demo[name][:] for name in ("actor", "corrections") if name in demo},
                    "source": json.loads(demo.attrs.get("source", "null")),
                }
                for demo in file["data"].values()
            ]
            return demos, json.loads(file["data"].attrs["recording"])
    about = json.loads((out / "meta" / "recording.json").read_text())
    rows = pq.read_table(out / "data").to_pydict()
    number = np.array(rows["episode_index"])
    names = [name for name in ("actor", "corrections") if name in rows]
    demos = [
        {
            **{name: np.array(rows[name])[number == i] for name in names},
            "source": episode.get("source"),
        }
        for i, episode in enumerate(about["episodes"])
    ]
    return demos, about


@pytest.fixture(scope="module")
def several(tmp_path_factory):
    """An expert's episode, one in which somebody takes over, and a correction."""
    folder = tmp_path_factory.mktemp("several")
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(registry.EXPERTS.registered, TASK, at_random)
        record(TASK, [0], folder, workers=0)
    record(TASK, [1], folder, workers=0, policy=Leans(), takeover=meddles)
    record(TASK, [2], folder, workers=0, policy=still, corrector=Leans())
    return folder


@pytest.mark.parametrize("form", ["robomimic", "lerobot"])
def test_several_sources_become_one_dataset(several, form):
    demos, about = saved(several, form)
    names = [actor.get("name", "").rpartition(":")[2] for actor in about["actors"]]
    assert [about["actors"][0], names] == [{"kind": "expert"}, ["", "Leans", "meddles", "still"]]
    with Recording(several / FILE) as file:
        assert [demo["source"] for demo in demos] == list(file.sources)
        assert (demos[0]["actor"] == 0).all()
        assert np.array_equal(demos[1]["actor"], file[1].actor + 1)
    assert (demos[2]["actor"] == 3).all()
    assert "corrections" not in demos[2]  # which the others lack


@pytest.mark.parametrize("form", ["robomimic", "lerobot"])
def test_corrections_become_a_column(tmp_path, form):
    record(TASK, [2, 3], tmp_path, workers=0, policy=still, corrector=Leans())
    demos, about = saved(tmp_path, form)
    assert [actor["name"] for actor in about["actors"]] == ["tests.data.policies:still"]
    with Recording(tmp_path / FILE) as file:
        for demo, episode in zip(demos, file, strict=True):
            assert np.array_equal(demo["corrections"], episode.corrections)
            assert "actor" not in demo
    with edited(tmp_path / FILE) as file:
        del file["traj_1/corrections"]
    (tmp_path / form).rename(tmp_path / "before")
    assert "corrections" not in saved(tmp_path, form)[0][0]


@dataclass
class Plays:
    """Goes through a plan, some steps of it, and remembers where it is."""

    plan: NDArray[np.float32]
    steps: range
    done: int = -1

    def __call__(self, obs):
        self.done += 1
        return self.plan[self.done] if self.done in self.steps else None


def test_a_converted_recording_knows_who_acted(tmp_path):
    task_id = "PushCube-v1"
    plan = find_expert(task_id)(tasks.make(task_id), 0)
    all_of_it, some = range(len(plan)), range(2, 5)
    given = {"policy": Plays(plan, all_of_it), "takeover": Plays(plan, some)}
    record(task_id, [0], tmp_path, workers=0, corrector=Plays(plan, all_of_it), **given)
    with Recording(tmp_path / FILE) as file:
        before = file[0]
        assert np.flatnonzero(before.actor).tolist() == list(some)
        assert convert(file, "pd_joint_vel", tmp_path / "other").complete
    with Recording(tmp_path / "other" / FILE) as file:
        after = file[0]
    assert after.source == before.source
    assert after.corrections is None
    steps = np.minimum(np.arange(len(after.actions)), len(before.actions) - 1)
    assert np.array_equal(after.actor, before.actor[steps])
