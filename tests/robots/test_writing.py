"""Files and folders that appear whole or not at all."""

import os
from concurrent.futures import ThreadPoolExecutor

import pytest

from layouts.export.files import replaced_folder
from robot_layouts.core.errors import UnwritableFileError
from robot_layouts.core.writing import claim, write_whole, writing_errors, written_whole
from robots import RecordingError, TaskError


def names(folder) -> list[str]:
    return sorted(path.name for path in folder.rglob("*"))


def test_a_file_takes_the_place_of_another_at_the_end(tmp_path):
    target = tmp_path / "in" / "cell.yaml"
    write_whole(target, "old ü")
    with written_whole(target, sync=True) as partial:
        partial.write_text("new")
        assert target.read_text(encoding="utf-8") == "old ü"
        assert partial.parent == target.parent
    assert target.read_text() == "new"
    assert names(tmp_path) == ["cell.yaml", "in"]
    assert target.stat().st_mode & 0o777 == 0o666 & ~_mask()


def _mask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


@pytest.mark.parametrize("reason", [TaskError("no robot"), KeyboardInterrupt(), OSError("full")])
def test_what_was_there_stays_and_nothing_else_is_left(tmp_path, reason):
    target = tmp_path / "cell.yaml"
    write_whole(target, b"old")

    def fail() -> None:
        with written_whole(target) as partial:
            partial.write_text("half")
            raise reason

    expected = UnwritableFileError if isinstance(reason, OSError) else type(reason)
    with pytest.raises(expected):
        fail()
    assert target.read_bytes() == b"old"
    assert names(tmp_path) == ["cell.yaml"]


def test_a_folder_appears_whole(tmp_path):
    target = tmp_path / "out"
    target.mkdir()
    with written_whole(target) as partial:
        (partial / "inner").mkdir(parents=True)
        assert not any(target.iterdir())
    assert names(target) == ["inner"]

    def fail() -> None:
        with written_whole(target) as partial:
            (partial / "other").mkdir(parents=True)

    with pytest.raises(UnwritableFileError, match="Directory not empty"):
        fail()
    assert names(tmp_path) == ["inner", "out"]


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("folder", "Is a directory"),
        ("file/cell.yaml", "file is not a folder"),
        ("nul\0", "a null character is in its name"),
        ("x" * 300, "File name too long"),
    ],
)
def test_a_refusal_names_the_file_and_why(tmp_path, name, reason):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError) as error:
        write_whole(tmp_path / name, "text", RecordingError)
    assert str(error.value).startswith(f"cannot write {tmp_path / name}: ")
    assert str(error.value).endswith(reason)
    assert names(tmp_path) == ["file", "folder"]


def test_the_parent_is_made_only_if_asked(tmp_path):
    with pytest.raises(UnwritableFileError, match="No such file or directory"):
        write_whole(tmp_path / "gone" / "cell.yaml", "text", parents=False)
    assert names(tmp_path) == []


def test_two_writers_of_one_file_do_not_meet(tmp_path):
    with written_whole(tmp_path / "cell") as one, written_whole(tmp_path / "cell") as other:
        one.write_text("one")
        other.write_text("other")
    assert (tmp_path / "cell").read_text() == "one"
    assert names(tmp_path) == ["cell"]


def in_threads(write, count=6):
    """Call something in several threads at once; what it raises is raised here."""
    with ThreadPoolExecutor(count) as pool:
        for done in [pool.submit(write) for _ in range(count)]:
            done.result()


def test_threads_replace_one_folder(tmp_path):
    def write():
        for _ in range(50):
            with replaced_folder(tmp_path / "assets", lambda found: True, "move it") as made:
                (made / "mesh.stl").write_text("")

    in_threads(write)
    assert names(tmp_path) == ["assets", "mesh.stl"]


def test_threads_claim_one_folder(tmp_path):
    holders = []

    def hold():
        for _ in range(300):
            if (lock := claim(tmp_path / "parts")) is not None:
                holders.append(lock)
                assert len(holders) == 1
                holders.clear()
                (tmp_path / "parts").rmdir()
                os.close(lock)

    in_threads(hold)


def test_a_page_of_words_by_hdf5_is_made_short(tmp_path):
    with pytest.raises(RecordingError, match="a.h5: No space left on device$"):  # noqa: SIM117
        with writing_errors("a.h5", RecordingError, (RuntimeError,)):
            raise RuntimeError("Can't write (file write failed: errno = 28, error message = …)")
