"""The Hugging Face Hub as it refuses, lies and fails while data sets are pushed and read."""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from unittest import mock

import pytest

from robot_layouts.data.export.push import DatasetPush, Sharing
from robot_layouts.data.reading.recording import Recording
from robots import RobotLayoutsError
from tests.data.recordings import record
from tests.data.writable_hub import TOKEN, WritableHub, running_hub
from tests.faults.fault import GOES_ON, Fault, each
from tests.robots import hub_server
from tests.robots.hub_server import page, status

AREA = "hub"
TASK, NAME = "PushT-v1", "lab/pushes"
GIT = ".gitattributes"  # which is there before anything is pushed
SECONDS = 2  # for an answer


ANSWERS: dict[str, hub_server.Fault] = {
    "a login page": hub_server.login_page,
    "no HTTP": hub_server.nonsense,
    "a reset": hub_server.reset,
    "a list": page(200, "[1]"),
    "a hundred thousand levels": page(200, "[" * 100_000),
    "a page that quotes the token": page(400, f"<p>bad token {TOKEN}</p>"),
    **{f"status {code}": status(code) for code in (400, 403, 404, 409, 451)},
}
REQUESTS = {
    "when it is to make a data set": ("POST", "/api/repos/create"),
    "when it is to list files": ("GET", "/tree/main"),
    "when it is asked how files are sent": ("POST", "/preupload/"),
    "when a large file is sent": ("PUT", "/lfs/"),
    "when it is to commit": ("POST", "/commit/"),
}
HARMLESS = {  # what the client takes as it should be
    ("when it is to make a data set", "status 409"),  # it is there already
    ("when it is to make a data set", "a list"),
    *(("when a large file is sent", f) for f in ("a list", "a login page")),
    ("when a large file is sent", "a hundred thousand levels"),
}

NAMES = {
    "empty": "hub:",
    "of one part": "hub:pushes",
    "that leads up": "hub:../..",
    "with a null character": "hub:lab/pushes\0",
    "of 200,000 letters": f"hub:lab/{'x' * 200_000}",
    "with an empty revision": "hub:lab/pushes@",
    "with a revision that leads up": "hub:lab/pushes@../../etc",
    "of nobody's data set": "hub:lab/others",
    "of a revision that is not there": "hub:lab/pushes@v9",
}
ENDPOINTS = {
    "of no scheme": "huggingface.co",
    "of port 99999": "http://127.0.0.1:99999",
    "of half an IPv6": "http://[::1",
    "where nobody listens": "http://127.0.0.1:9",
}

Files = dict[str, bytes]
CONTENTS: dict[str, Callable[[Files], Files]] = {
    "nothing": lambda files: {},
    "no h5 file": lambda files: {"trajectory.json": files["trajectory.json"]},
    "no json": lambda files: {"trajectory.h5": files["trajectory.h5"]},
    "a json of 100,000 brackets": lambda files: {**files, "trajectory.json": b"[" * 100_000},
    "a text as h5 file": lambda files: {**files, "trajectory.h5": b"version https://git-lfs"},
    "half an h5 file": lambda files: {**files, "trajectory.h5": _half(files["trajectory.h5"])},
    "an h5 file with other actions": lambda files: {
        **files, "trajectory.h5": _other_actions(files["trajectory.h5"])
    },
}  # fmt: skip


def faults() -> Iterator[Fault]:
    """Go through this area's faults."""
    for when, request in REQUESTS.items():
        for what, fault in ANSWERS.items():
            if (when, what) not in HARMLESS:
                run = functools.partial(_not_pushed, request=request, fault=fault)
                yield Fault(AREA, f"it answers {what} {when}", run)
    for when in ("a data set", "files"):
        part = "/revision/" if when == "a data set" else "/tree/"
        for what, fault in ANSWERS.items():
            run = functools.partial(_not_read, request=("GET", part), fault=fault)
            yield Fault(AREA, f"it answers {what} when {when} to be read are looked up", run)
    yield from each(AREA, "a name {}", _not_read, NAMES)
    for what, address in ENDPOINTS.items():
        yield Fault(AREA, f"reading at an address {what}", functools.partial(_elsewhere, address))
        run = functools.partial(_elsewhere, address, push=True)
        yield Fault(AREA, f"pushing to an address {what}", run)
    yield from each(AREA, "it holds {}", _holds, CONTENTS)
    yield Fault(AREA, "a name that would lead out of the cache", _escapes, GOES_ON)


# -- a Hub, and what is pushed --------------------------------------------------------------------


@functools.cache
def _recorded() -> Path:
    """Return the folder of a small recording, which stays as it is."""
    folder = Path(tempfile.mkdtemp()) / "recording"
    folder.mkdir()
    record(folder / "trajectory.h5", TASK, [2])
    return folder


def _hub(folder: Path) -> AbstractContextManager[WritableHub]:
    waits = {"HF_HUB_DOWNLOAD_TIMEOUT": SECONDS, "HF_HUB_ETAG_TIMEOUT": SECONDS}
    return running_hub(folder, **waits)


def _push() -> str:
    return DatasetPush.of(_recorded(), NAME, Sharing())()


def _read(name: str = f"hub:{NAME}") -> int:
    """Read all episodes; returns how many."""
    with Recording(name) as file:
        return len([file[number] for number in range(len(file))])


def _without_token(run: Callable[[], object]) -> None:
    with pytest.raises(RobotLayoutsError) as caught:
        run()
    assert TOKEN not in str(caught.value), "the message holds the token"
    raise caught.value


# -- what goes wrong ------------------------------------------------------------------------------


def _not_pushed(folder: Path, request: tuple[str, str], fault: hub_server.Fault) -> None:
    with _hub(folder) as hub:
        hub.fail(*request, fault)
        try:
            _without_token(_push)
        finally:
            repository = hub.repositories.get(NAME)
            there = {} if repository is None else repository.commits[repository.head]
            assert set(there) <= {GIT}, "something half-done can be seen there"


def _not_read(
    folder: Path,
    name: str = f"hub:{NAME}",
    request: tuple[str, str] | None = None,
    fault: hub_server.Fault | None = None,
) -> None:
    with _hub(folder) as hub:
        _push()
        if request is not None and fault is not None:
            hub.fail(*request, fault)
        _without_token(lambda: _read(name))


def _elsewhere(address: str, folder: Path, *, push: bool = False) -> None:
    with _hub(folder), mock.patch.dict("os.environ", {"HF_ENDPOINT": address}):
        _without_token(_push if push else _read)


def _holds(folder: Path, change: Callable[[Files], Files]) -> None:
    with _hub(folder) as hub:
        _push()
        repository = hub.repositories[NAME]
        repository.commit(change(dict(repository.commits[repository.head])))
        _read()


def _half(data: bytes) -> bytes:
    return data[: len(data) // 2]


def _other_actions(data: bytes) -> bytes:
    """Return an h5 file in which an action is another, and the checksum of what it was."""
    import h5py

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "trajectory.h5"
        path.write_bytes(data)
        with h5py.File(path, "r+") as file:
            file["traj_0/actions"][0, 0] += 0.5
        return path.read_bytes()


def _escapes(folder: Path) -> str:
    """A data set names files outside of itself; reading it writes no file elsewhere."""
    with _hub(folder) as hub:
        _push()
        repository = hub.repositories[NAME]
        files = dict(repository.commits[repository.head])
        evil = {f"trajectory_{'../' * n}evil.json": b"evil" for n in (1, 3, 12)}
        repository.commit({**files, **evil, "../trajectory_evil.json": b"evil"})
        try:
            said = f"read {_read()} episode"
        except RobotLayoutsError as error:
            said = str(error)
        outside = [path for path in folder.rglob("*evil*") if "hf_home/hub/" not in str(path)]
        assert not outside, f"{outside} was written"
        return said
