"""A recording from anyone is read without reading, loading, or losing anything else.

`make faults` tries several hundred more; see `tests.faults.recording_h5_faults` and its neighbours.
"""

import mmap
import os
import struct
import threading
import time

import h5py
import numpy as np
import pytest

from robot_layouts.data.export.dataset import Export, export
from robot_layouts.data.reading import hdf5
from robot_layouts.data.reading.hdf5 import ContentError, Hdf5File, LimitError, limited
from robot_layouts.data.reading.recording import Recording, TrajectoryError
from tests.data.recordings import edited, record

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
        (external_storage, "Tee declares shape .*, but not all of it is in the file"),
        (external_link, "not read, such as links to other files"),
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


def test_a_file_of_others_is_read_as_h5py_reads_it(tmp_path):
    rng = np.random.default_rng(0)
    arrays = {
        "flags": rng.random(500) > 0.5,
        "bytes": np.arange(9, dtype="u1"),
        "halves": np.ones((3, 3), "f2"),
        "doubles": rng.normal(size=(30, 2)),
        "turned": np.arange(5, dtype=">f4"),
        "large": rng.normal(size=(200_000, 7)).astype("f4"),
        "none": np.zeros((0, 3), "f4"),
    }
    packed = {"compression": "gzip", "shuffle": True, "fletcher32": True}
    for version in ("earliest", "v108"):
        for how in ({}, {"chunks": True}, {"compression": "gzip"}, {"shuffle": True}, packed):
            with h5py.File(tmp_path / "file.h5", "w", libver=(version, "latest")) as file:
                file.attrs.update({"text": "Größe", "fixed": np.bytes_(b"text")})
                for name, rows in arrays.items():
                    file.create_dataset(f"traj_0/{name}", data=rows, **(how if rows.size else {}))
            with Hdf5File(tmp_path / "file.h5") as file:
                assert file.texts() == {"text": "Größe", "fixed": "text"}
                found = file.numbers("traj_0")
            assert list(found) == sorted(arrays)
            for name, rows in arrays.items():
                assert found[name].dtype == rows.dtype
                np.testing.assert_array_equal(found[name], rows)


def wait_for_ever():
    with limited(0.1):
        while True:
            pass


def take_memory():
    kept = []
    with limited(60):
        while len(kept) < 2**12:
            kept.append(mmap.mmap(-1, 2**16))  # no room that was left when something else went
            kept[-1].write(bytes(2**16))
            time.sleep(0.001)


class TestLimits:
    """Whatever a file leads pyfive to do ends."""

    def test_what_takes_too_long_is_interrupted(self):
        with pytest.raises(LimitError, match="more time or memory"):
            wait_for_ever()
        time.sleep(0.2)  # and nothing else is

    def test_what_takes_too_much_memory_is_interrupted(self, monkeypatch):
        monkeypatch.setattr(hdf5, "MEMORY", 2**24)
        with pytest.raises(LimitError):
            take_memory()

    def test_a_header_that_goes_on_in_itself(self, path, monkeypatch):
        """pyfive would read its last block again and again."""
        monkeypatch.setattr(hdf5, "SECONDS", 0.2)
        content = bytearray(path.read_bytes())
        block = content.index(b"OCHK")
        length = content.index(struct.pack("<Q", block)) + 8
        onwards = struct.pack("<BHBQ", 16, 16, 0, block) + content[length : length + 8]
        content[block + 4 : block + 4 + len(onwards)] = onwards
        path.write_bytes(content)
        with pytest.raises(TrajectoryError, match="more time or memory"):
            Recording(path)

    def test_lists_that_contain_themselves(self, path, monkeypatch):
        """pyfive would unfold lists of lists of lists, all the same one, without reading more."""
        monkeypatch.setattr(hdf5, "SECONDS", 0.2)
        kind, count = h5py.h5t.NATIVE_FLOAT, 64
        for _ in range(8):
            kind = h5py.h5t.vlen_create(kind)
        with h5py.File(path, "w", libver=("v108", "latest")) as file:
            group = file.create_group("traj_0")
            h5py.h5a.create(group.id, b"lists", kind, h5py.h5s.create(h5py.h5s.SCALAR))
            group.attrs["text"] = "-" * 16 * count
        content = bytearray(path.read_bytes())
        text = content.index(b"-" * 16 * count)
        one = struct.pack("<IQHH", count, content.index(b"GCOL"), content[text - 16], 0)
        content[text : text + 16 * count] = one * count
        name = content.index(b"lists\0")
        value = name + sum(struct.unpack("<HHH", content[name - 7 : name - 1]))
        content[value : value + 16] = one
        path.write_bytes(content)
        with Hdf5File(path) as file, pytest.raises(LimitError):
            file.texts("traj_0", ("text",))


class TestOpenFiles:
    """Files that are open."""

    def test_a_closed_file_is_not_read(self, path):
        file = Hdf5File(path)
        file.close()
        file.close()
        with pytest.raises(ContentError, match="it was closed"):
            file.numbers("traj_0")

    def test_many_threads_may_read(self, path, whole):
        wrong = []

        def read(one):
            with Recording(one) as file:
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
                os._exit(0 if len(file.numbers("traj_1")["actions"]) == 4 else 1)
            assert os.waitpid(child, 0)[1] == 0
            assert len(file.numbers("traj_1")["actions"]) == 4
