"""A recording from anyone is read without reading, loading, or losing anything else.

`make faults` tries several hundred more; see `tests.faults.recording_h5_faults` and its neighbours.
"""

import json
import os
import signal
import threading

import h5py
import numpy as np
import pytest

import rollouts.reading.hdf5_file as hdf5_file
from robots import UnreadableFileError
from rollouts.export.dataset import Export, export
from rollouts.reading.hdf5_file import Hdf5File
from rollouts.reading.hdf5_reading import ContentError
from rollouts.reading.trajectory import TrajectoryError, TrajectoryFile
from tests.rollouts.recordings import edited, record

SECRET = b"root:x:0:0: a secret in another file\n" * 20
SHAPE = (4, 13)  # of the states of the first episode's block
TEE = "traj_0/env_states/actors/Tee"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return record(tmp_path_factory.mktemp("whole") / "trajectory.h5", "PushT-v1", [3, 4])


@pytest.fixture
def path(whole, tmp_path):
    for suffix in (".h5", ".json"):
        content = whole.with_suffix(suffix).read_bytes()
        (tmp_path / whole.name).with_suffix(suffix).write_bytes(content)
    return tmp_path / whole.name


def external_storage(file, secret):
    file.create_dataset(TEE, SHAPE, "f4", external=str(secret))


def external_link(file, secret):
    file[TEE] = h5py.ExternalLink(str(secret), "/numbers")


def virtual(file, secret):
    layout = h5py.VirtualLayout(SHAPE, "f4")
    layout[...] = h5py.VirtualSource(str(secret), "numbers", SHAPE)
    file.create_virtual_dataset(TEE, layout)


@pytest.mark.parametrize(
    ("refer", "why"),
    [
        (external_storage, "the numbers of Tee are in other files"),
        (external_link, "Tee is a link to somewhere else"),
        (virtual, "Tee is a virtual array, whose numbers are in other files"),
    ],
)
def test_an_export_holds_no_bytes_of_other_files(path, tmp_path, refer, why):
    secret = tmp_path / "secret"
    if refer is external_storage:
        secret.write_bytes(SECRET)
    else:
        with h5py.File(secret, "w") as other:
            other["numbers"] = np.frombuffer(SECRET[: 4 * 52], np.float32).reshape(SHAPE)
    with edited(path) as file:
        del file[TEE]
        refer(file, secret)
    for name in ("lerobot", "robomimic"):
        with pytest.raises(TrajectoryError, match=why):
            export(Export(path, name, tmp_path / "out", include_failures=True))
    assert {p.name for p in tmp_path.iterdir()} == {"trajectory.h5", "trajectory.json", "secret"}


@pytest.mark.parametrize("rows", [2**31, 10**12])
def test_an_array_that_is_larger_than_any_memory_is_refused(path, rows):
    with edited(path) as file:
        del file["traj_0/actions"]
        chunks = (2**20, 7)
        file.create_dataset("traj_0/actions", (rows, 7), "f4", chunks=chunks, compression="gzip")
    with TrajectoryFile(path) as file, pytest.raises(TrajectoryError, match="at most 1,073,741,8"):
        file[0]


def test_actions_must_be_of_the_steps_that_the_json_says(path):
    beside = path.with_suffix(".json")
    summary = json.loads(beside.read_text())
    summary["episodes"][0]["elapsed_steps"] = 2
    beside.write_text(json.dumps(summary))
    with TrajectoryFile(path) as file:
        with pytest.raises(TrajectoryError, match=r"shape \(3, 7\); the json .* says 2 steps"):
            file.expect("PushT-v1", 7)
        with pytest.raises(TrajectoryError, match=r"shape \(3, 7\); the json .* says 2 steps"):
            file[0]


@pytest.mark.parametrize(
    ("where", "value", "why"),
    [
        ("env_kwargs", ["a"], r"env_info.env_kwargs is \['a'\]; it must be an object or None"),
        ("env_kwargs", "text", "env_info.env_kwargs is 'text'; it must be"),
        ("reset_kwargs", ["a"], r"episodes\[0\].reset_kwargs is \['a'\]; it must be an object"),
        ("reset_kwargs", {"options": "x"}, r"episodes\[0\].reset_kwargs.options is 'x'; it must"),
        ("reset_kwargs", {"seed": -1}, r"reset_kwargs.seed is -1; it must be a whole number from"),
        ("elapsed_steps", "3", r"episodes\[0\].elapsed_steps is '3'; it must be a whole number"),
    ],
)
def test_every_value_of_the_json_is_looked_at(path, where, value, why):
    beside = path.with_suffix(".json")
    summary = json.loads(beside.read_text())
    holder = summary["env_info"] if where == "env_kwargs" else summary["episodes"][0]
    holder[where] = value
    beside.write_text(json.dumps(summary))
    with pytest.raises(TrajectoryError, match=why):
        TrajectoryFile(path)


@pytest.mark.parametrize(
    ("layout", "why"),
    [
        ([1], r"layout is \[1\]; it must be an object"),
        ({"arm": {"robot": "panda"}}, "it has no layout\['arm'\].position"),
        ("[" * 100_000, "attribute layout: its json nests deeper"),
    ],
)
def test_every_value_of_the_attributes_is_looked_at(path, layout, why):
    with edited(path) as file:
        file.attrs["layout"] = layout if isinstance(layout, str) else json.dumps(layout)
    with pytest.raises(TrajectoryError, match=why):
        TrajectoryFile(path)


@pytest.mark.parametrize("name", ["trajectory.h5", "trajectory.json"])
def test_a_fifo_is_not_waited_for(path, name):
    path.with_name(name).unlink()
    os.mkfifo(path.with_name(name))
    with pytest.raises(TrajectoryError, match="it is a FIFO, not a regular file"):
        TrajectoryFile(path)


def test_a_bit_that_flipped_is_not_played(path):
    with h5py.File(path) as file:
        place = file["traj_1/rewards"].id.get_offset()
    content = bytearray(path.read_bytes())
    content[place] ^= 1
    path.write_bytes(content)
    with TrajectoryFile(path) as file:
        assert len(file[0].actions) == 3
        with pytest.raises(TrajectoryError, match="traj_1 .* its checksum is another"):
            file[1]


def test_a_file_of_an_earlier_version_has_no_checksums_and_is_read(path, whole):
    with edited(path):
        pass
    with TrajectoryFile(path) as earlier, TrajectoryFile(whole) as file:
        for one, other in zip(earlier, file, strict=True):
            np.testing.assert_array_equal(one.actions, other.actions)


class TestTheReadingProcess:
    """HDF5 may crash, or never come to an end; that happens in a process of its own."""

    def test_a_death_is_an_error_and_the_next_file_is_read(self, path):
        with Hdf5File(path) as file:
            os.kill(hdf5_file._readers[0]._process.pid, signal.SIGKILL)
            with pytest.raises(ContentError, match=r"HDF5 crashed reading it \(exit code -9\)"):
                file.members()
            assert file.members() == ["traj_0", "traj_1"]

    @pytest.mark.long
    def test_a_file_without_end_is_an_error(self, path):
        """Texts of attributes are followed by free space of no size, which HDF5 walks for ever."""
        content = path.read_bytes()
        first = content.index(b"GCOL") + 16
        size = int.from_bytes(content[first + 8 : first + 16], "little")
        second = first + 16 + -(-size // 8) * 8
        path.write_bytes(content[:second] + bytes(16) + content[second + 16 :])
        with pytest.raises(TrajectoryError, match="HDF5 does not come to an end reading it"):
            TrajectoryFile(path)

    def test_a_closed_file_is_not_read(self, path):
        file = Hdf5File(path)
        file.close()
        file.close()
        with pytest.raises(ContentError, match="it was closed"):
            file.members()
        with h5py.File(path, "r+"):  # nobody holds it any more
            pass

    def test_a_forgotten_file_is_closed_with_the_next_request(self, path):
        file = Hdf5File(path)
        del file
        Hdf5File(path).close()
        with h5py.File(path, "r+"):
            pass

    def test_many_threads_may_read(self, path, whole):
        wrong = []

        def read(one):
            with TrajectoryFile(one) as file:
                for _ in range(20):
                    if [len(episode.actions) for episode in file] != [3, 4]:
                        wrong.append(one)

        threads = [threading.Thread(target=read, args=(p,)) for p in (path, whole) * 3]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert not wrong

    def test_a_fork_reads_for_itself(self, path):
        with Hdf5File(path) as file:
            child = os.fork()
            if not child:
                os._exit(0 if file.members() == ["traj_0", "traj_1"] else 1)
            assert os.waitpid(child, 0)[1] == 0
            assert file.members() == ["traj_0", "traj_1"]

    def test_a_missing_file_is_named(self, tmp_path):
        with pytest.raises(UnreadableFileError, match="No such file"):
            Hdf5File(tmp_path / "none.h5")
