"""The wheel of a package as a source of robot files: downloaded once, by the user's own pip."""

from __future__ import annotations

import lzma
import os
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

from robots.assets.manifest import AssetFile, load_manifest
from robots.assets.packages import IndexPackage, SourceError
from robots.assets.progress import download_bar, say
from robots.assets.sources import Contents, expect_none
from robots.common.child_process import running

LARGEST_DOWNLOAD = 600 * 10**6  # bytes, of all that pip writes
LEAST_RATE = 1000  # bytes per second

_PATIENCE = 300.0  # s; pip has deadlines and retries of its own
_BAD_ARCHIVE = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    EOFError,
    OSError,
    RuntimeError,  # encrypted; a NotImplementedError is one, too: an unknown compression
    ValueError,
)


class PackageWheel:
    """The wheel of a package, downloaded with the user's own pip and configuration.

    It is large, and not kept: what it has for other robots is given along with what was asked for.
    """

    name = "wheel"

    def __init__(self, package: IndexPackage, *, patience: float = _PATIENCE) -> None:
        """Take the package, and how long next to nothing may arrive before pip is given up (s)."""
        self._package, self._patience = package, patience
        self.title = f"{package.name} wheel through pip"

    def holds(self, file: AssetFile) -> bool:
        """Tell whether a file is of its package."""
        return file.origin.distribution == self._package.name

    def fetch(
        self, files: Sequence[AssetFile], scratch: Path, *, again: bool, trust: bool
    ) -> Contents:
        """Download the wheel and yield what it holds; see `robots.assets.sources.AssetSource`."""
        for requirement in sorted({file.origin.wheel for file in files}):
            wanted = [file for file in files if file.origin.wheel == requirement]
            with tempfile.TemporaryDirectory(dir=scratch) as folder:
                say(
                    f"downloading the wheel of {requirement}"
                    f" (about {self._package.megabytes} MB) with pip"
                )
                wheel = _download_wheel(requirement, Path(folder), self._patience, again)
                others = [] if again else _files_beside(wanted, requirement)
                yield from _unpack(wheel, wanted, others, trust=trust)


def _files_beside(wanted: Sequence[AssetFile], requirement: str) -> list[AssetFile]:
    packages = load_manifest().packages.values()
    files = [f for package in packages for f in package.files if f.origin.wheel == requirement]
    return [file for file in files if file not in set(wanted)]


def _unpack(
    wheel: Path, wanted: Sequence[AssetFile], others: Sequence[AssetFile], *, trust: bool
) -> Contents:
    absent: list[str] = []
    try:
        archive = zipfile.ZipFile(wheel)
    except _BAD_ARCHIVE as error:
        raise SourceError(f"{wheel.name} is damaged: {error}") from error
    with archive:
        members = set(archive.namelist())
        for file in wanted:
            if _member(file) in members:
                yield file, _read_member(archive, file, file.limit(trust=trust))
            else:
                absent.append(_member(file))
        for file in others:
            if _member(file) in members:
                yield file, _read_member(archive, file, file.bytes)
    expect_none(absent)


def _member(file: AssetFile) -> str:
    return f"{file.origin.folder}/{file.path}"


def _read_member(archive: zipfile.ZipFile, file: AssetFile, limit: int) -> bytes | None:
    try:
        with archive.open(_member(file)) as stream:
            data = stream.read(limit + 1)  # whatever size the archive claims
            return data if len(data) <= limit else None
    except _BAD_ARCHIVE as error:
        raise SourceError(f"the wheel's {file} is damaged: {error}") from error


def _download_wheel(requirement: str, folder: Path, patience: float, again: bool) -> Path:
    command = [
        *_pip_command(),
        "download",
        "--no-deps",
        "--only-binary=:all:",
        "--no-input",
        "--disable-pip-version-check",
        "--retries=2",
        *(("--no-cache-dir",) if again else ()),
        f"--dest={folder}",
        requirement,
    ]
    log = folder / "pip.log"
    environment = {**os.environ, "TMPDIR": str(folder)}  # removed with the folder, come what may
    try:
        with (
            log.open("wb") as output,
            running(
                command, stdin=subprocess.DEVNULL, stdout=output, stderr=output, env=environment
            ) as process,
        ):
            _wait(process, folder, requirement, patience)
    except OSError as error:
        if isinstance(error, SourceError):
            raise
        raise SourceError(f"cannot run pip: {error.strerror}") from error
    wheels = sorted(folder.glob("*.whl"))
    if process.returncode != 0 or not wheels:
        raise SourceError(_last_words(log.read_text(encoding="utf-8", errors="replace")))
    return wheels[0]


def _wait(
    process: subprocess.Popen[bytes], folder: Path, requirement: str, patience: float
) -> None:
    """Wait until pip ends; refuse what is endless, and what comes too slowly ever to end."""
    shown, counted, deadline = 0, 0, time.monotonic() + patience
    with download_bar(requirement, total=None) as advance:
        while process.poll() is None:
            size = sum(_sizes(folder))
            advance(max(0, size - shown))
            shown = max(shown, size)
            if size > LARGEST_DOWNLOAD:
                raise SourceError(f"pip wrote {size:,} bytes, without an end")
            if size - counted >= LEAST_RATE * patience:
                counted, deadline = size, time.monotonic() + patience
            if time.monotonic() > deadline:
                raise SourceError(f"next to nothing arrived through pip for {patience:g} s")
            _doze(process)


def _doze(process: subprocess.Popen[bytes]) -> None:
    try:
        process.wait(0.2)
    except subprocess.TimeoutExpired:
        pass


def _sizes(folder: Path) -> Iterator[int]:
    for parent, _, names in os.walk(folder):
        for name in names:
            try:
                yield os.lstat(os.path.join(parent, name)).st_size
            except FileNotFoundError:  # pip has just moved or removed it
                continue


def _pip_command() -> list[str]:
    if sys.executable and find_spec("pip") is not None:
        return [sys.executable, "-m", "pip"]
    uv = shutil.which("uv")
    if uv is not None:
        return [os.path.abspath(uv), "tool", "run", "pip"]
    raise SourceError("this Python has no pip (python -m ensurepip adds it), and there is no uv")


def _last_words(log: str) -> str:
    lines = [line.strip() for line in log.splitlines() if line.strip()]
    errors = [line.removeprefix("ERROR: ") for line in lines if line.startswith("ERROR: ")]
    if errors and errors[-1] == "Exception:":  # and its traceback, in the log alone
        errors = [lines[-1]]
    return "pip failed: " + (errors or lines or ["it printed nothing"])[-1]
