"""TensorBoard and Weights & Biases: their own readers find what commands and examples log."""

import json
import os
import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[3] / "examples"))

import ppo_push_cube
import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from wandb.proto.wandb_internal_pb2 import Record

from robot_layouts.__main__ import main
from robot_layouts.core.errors import UnwritableFileError
from robot_layouts.data import evaluate
from robot_layouts.data.log import opened_log

STILL = "tests.data.policies:still"
OUT = Path(sys.argv[1])


def curves(folder):
    """Return steps and numbers of each curve, as TensorBoard reads them."""
    read = EventAccumulator(str(folder))
    read.Reload()
    return {
        name: {event.step: event.value for event in read.Scalars(name)}
        for name in read.Tags()["scalars"]
    }


def an_evaluation():
    words = ["--task=PushT-v1", f"--policy={STILL}", "--episodes=3", "--workers=0"]
    assert main(["evaluate", *words, f"--log=tensorboard:{OUT / 'still'}"]) == 0
    found, scores = curves(OUT / "still"), evaluate(STILL, "PushT-v1", range(3), workers=0)
    assert set(found) == {"success", "return", "steps"}
    assert found["success"] == {1: 0, 2: 0, 3: 0}
    assert list(found["steps"].values()) == list(scores.lengths.values())
    assert list(found["return"].values()) == pytest.approx(list(scores.returns.values()))


def stages():
    words = ["--task=CellPutAndClose-v1", "--episodes=1", "--workers=0"]
    assert main(["evaluate", *words, f"--log=tensorboard:{OUT / 'cell'}"]) == 0
    assert curves(OUT / "cell")["stage_score"] == {1: 1.0}


def an_example():
    ppo_push_cube.EXAMINED_EVERY = 100
    words = ["--steps=150", "--envs=4", "--tests=2", "--workers=0", f"--out={OUT / 'ppo'}"]
    assert ppo_push_cube.main([*words, f"--log=tensorboard:{OUT / 'ppo_log'}"]) == 1
    curve = json.loads((OUT / "ppo" / "learning_curve.json").read_text())["curve"]
    found = curves(OUT / "ppo_log")
    assert set(found) == set(curve[0]) - {"steps"}
    for name, points in found.items():
        assert list(points) == [point["steps"] for point in curve]
        assert list(points.values()) == pytest.approx([point[name] for point in curve])


def a_folder_that_is_a_file():
    (OUT / "file").touch()
    with pytest.raises(UnwritableFileError), opened_log(f"tensorboard:{OUT / 'file'}"):
        pass


def history(file):
    """Return the numbers of each step in the file of a run that was offline.

    It is a log as LevelDB writes it: blocks of 32 kB, in which each part of a record has a head of
    7 bytes (checksum, length, kind), after 7 bytes of the file's own.
    """
    data, place, record, found = file.read_bytes(), 7, b"", []
    while place < len(data):
        if 2**15 - place % 2**15 < 7:  # no room for a head
            place += 2**15 - place % 2**15
            continue
        size, kind = int.from_bytes(data[place + 4 : place + 6], "little"), data[place + 6]
        record += data[place + 7 : place + 7 + size]
        place += 7 + size
        if kind in (1, 4):  # whole, or the last part
            told = Record.FromString(record)
            if told.HasField("history"):
                items = told.history.item
                found.append({i.key or i.nested_key[0]: json.loads(i.value_json) for i in items})
            record = b""
    return found


def weights_and_biases():
    os.environ.update(WANDB_MODE="offline", WANDB_DIR=str(OUT), WANDB_SILENT="true")
    words = ["--task=PushT-v1", f"--policy={STILL}", "--episodes=2", "--workers=0"]
    assert main(["evaluate", *words, "--log=wandb:tests"]) == 0
    (file,) = OUT.glob("wandb/offline-run-*/run-*.wandb")
    found, scores = history(file), evaluate(STILL, "PushT-v1", range(2), workers=0)
    assert [point["_step"] for point in found] == [1, 2]
    assert [point["return"] for point in found] == list(scores.returns.values())
    assert found[-1].keys() >= {"success", "steps"}


if __name__ == "__main__":
    an_evaluation()
    stages()
    an_example()
    a_folder_that_is_a_file()
    weights_and_biases()
