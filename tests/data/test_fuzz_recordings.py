"""Whatever bytes a recording consists of, reading it ends, and in one of our errors if it fails."""

import copy
import json
import shutil
import struct
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import tasks
from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.reading.recording import Recording
from robot_layouts.data.recording.episode_files import read_joined, read_part
from robot_layouts.data.recording.recorder import Recorder
from robots import RobotLayoutsError
from tasks.episode import play
from tests.data.recordings import edited

TASK = "PushT-v1"
FUZZED = settings(
    max_examples=400,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    print_blob=True,
)

# What HDF5's structures begin with; changes there go deeper than those of numbers.
SIGNATURES = (b"OHDR", b"OCHK", b"TREE", b"HEAP", b"SNOD", b"FRHP", b"FHDB", b"BTHD", b"GCOL")

Edit = tuple[int, int, bytes]  # which place, how far behind it, what to write there

edits = st.lists(
    st.tuples(
        st.integers(0, 10**6),
        st.integers(0, 80),
        st.one_of(
            st.binary(min_size=1, max_size=8),
            st.sampled_from([0, 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1]).map(
                lambda number: struct.pack("<Q", number)
            ),
        ),
    ),
    min_size=1,
    max_size=6,
)


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """Return a folder with a recording, the same as earlier versions wrote it, and a part."""
    folder = tmp_path_factory.mktemp("made")
    env = tasks.make(TASK, obs_mode="none")
    rng = np.random.default_rng(0)
    for name in ("recording", "earlier"):
        with Recorder(folder / f"{name}.h5", env) as recorder:
            for seed in range(2):
                actions = rng.uniform(-1, 1, (2, env.layout.action_dim)).astype(np.float32)
                recorder.add(play(env, seed, actions))
            (folder / "seed-0000000000.part").write_bytes(
                (recorder.parts / "seed-0000000000.part").read_bytes()
            )
    with edited(folder / "earlier.h5") as file:
        for episode in file.values():
            rows = episode["actions"][()]
            del episode["actions"]
            episode.create_dataset("actions", data=rows, compression="gzip", shuffle=True)
    return folder


def changed(content: bytes, changes: list[Edit]) -> bytes:
    """Write over a file, some bytes behind where its structures begin, or anywhere."""
    found = bytearray(content)
    places = [place for place in range(len(content)) if content[place : place + 4] in SIGNATURES]
    for which, behind, new in changes:
        start = places[which % len(places)] if places and which % 2 else which % len(content)
        place = min(start + behind, len(found) - 1)
        found[place : place + len(new)] = new[: len(found) - place]
    return bytes(found)


def read(path: Path) -> None:
    """Read all of a file as a replay, and then as going on with a recording does."""
    for reading in (lambda: list(Recording(path)), lambda: read_joined(path)):
        with suppress(RobotLayoutsError):
            reading()


@pytest.mark.long
@FUZZED
@given(name=st.sampled_from(["recording", "earlier"]), changes=edits)
@example(name="recording", changes=[(0, 0, b"\0")])  # no h5 file any more
@example(name="earlier", changes=[(1, 16, bytes(62))])
def test_an_h5_file_of_any_bytes(made, tmp_path, name, changes):
    path = tmp_path / "fuzzed.h5"
    path.write_bytes(changed((made / f"{name}.h5").read_bytes(), changes))
    shutil.copy(made / f"{name}.json", path.with_suffix(".json"))
    read(path)


@pytest.mark.long
@settings(FUZZED, max_examples=50)
@given(changes=edits)
def test_an_export_of_any_bytes(made, tmp_path, changes):
    path = tmp_path / "fuzzed.h5"
    path.write_bytes(changed((made / "earlier.h5").read_bytes(), changes))
    shutil.copy(made / "earlier.json", path.with_suffix(".json"))
    with suppress(RobotLayoutsError):
        export(Export(path, "robomimic", tmp_path / "out", include_failures=True))
    shutil.rmtree(tmp_path / "out", ignore_errors=True)
    assert {p.name for p in tmp_path.iterdir()} == {"fuzzed.h5", "fuzzed.json"}


@pytest.mark.long
@FUZZED
@given(changes=edits)
def test_a_part_of_any_bytes(made, tmp_path, changes):
    part = made / "seed-0000000000.part"
    path = tmp_path / part.name
    path.write_bytes(changed(part.read_bytes(), changes))
    with suppress(RobotLayoutsError):
        read_part(path)
        assert path.read_bytes() == part.read_bytes()  # as its checksum says


values = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.floats(),
        st.text(max_size=8),
        st.sampled_from(["pd_joint_pos", TASK, 2**32, -1, 1e308]),
    ),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner),
    max_leaves=6,
)


def places(value, prefix=()):
    """Return the keys of everything inside a json value."""
    found = [prefix] if prefix else []
    if isinstance(value, (dict, list)):
        for key in value if isinstance(value, dict) else range(len(value)):
            found += places(value[key], (*prefix, key))
    return found


@pytest.mark.long
@FUZZED
@given(which=st.lists(st.integers(0, 10**6), min_size=1, max_size=3), value=values)
@example(which=[7], value="")
def test_a_json_of_any_values(made, tmp_path, which, value):
    path = tmp_path / "fuzzed.h5"
    shutil.copy(made / "recording.h5", path)
    summary = json.loads((made / "recording.json").read_text())
    for number in which:
        known = places(summary)
        *above, last = known[number % len(known)]
        holder = summary
        for key in above:
            holder = holder[key]
        holder[last] = copy.deepcopy(value)
    path.with_suffix(".json").write_text(json.dumps(summary))
    read(path)


@pytest.mark.long
@FUZZED
@given(changes=edits)
def test_a_json_of_any_bytes(made, tmp_path, changes):
    path = tmp_path / "fuzzed.h5"
    shutil.copy(made / "recording.h5", path)
    content = (made / "recording.json").read_bytes()
    path.with_suffix(".json").write_bytes(changed(content, changes))
    read(path)
