"""Where robot files can be had: another local copy, the Hub, an installed mani_skill, its wheel."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Generator, Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol

from robots.asset_store import AssetStore, FileState
from robots.errors import AssetError
from robots.manifest import AssetFile
from robots.progress import download_bar, say

Contents = Generator[tuple[AssetFile, bytes], None, None]

_WHEEL_SIZE_HINT = "about 100 MB"


class SourceError(AssetError):
    """Why one source could not give every file it was asked for."""


class AssetSource(Protocol):
    """A place that robot files can be fetched from."""

    @property
    def name(self) -> str:
        """Name on the command line."""
        ...

    @property
    def title(self) -> str:
        """Name in messages."""
        ...

    def fetch(self, files: Sequence[AssetFile], scratch: Path, *, again: bool) -> Contents:
        """Yield the contents of files, unchecked, as they arrive.

        Args:
            files: What is wanted.
            scratch: A folder for temporary files.
            again: Whether these files were wrong a moment ago, so that caches must be passed by.

        Raises:
            SourceError: If some file cannot be had; those that can be are yielded before.
        """
        ...


class LocalCopy:
    """A local copy, as a source for another folder."""

    name = "local"

    def __init__(self, root: Path, *, states: Iterable[FileState] = (FileState.VERIFIED,)) -> None:
        """Read from a folder, taking only files in some states."""
        self._store = AssetStore(root)
        self._states = frozenset(states)
        self.title = f"local copy {root}"

    def fetch(self, files: Sequence[AssetFile], scratch: Path, *, again: bool) -> Contents:
        """Yield what the copy holds; see `AssetSource`."""
        absent: list[str] = []
        for file in files:
            try:
                state = self._store.state(file)
            except AssetError as error:
                raise SourceError(str(error)) from error
            if state in self._states:
                yield file, self._store.path(file).read_bytes()
            else:
                absent.append(f"{file} ({state.value})")
        _expect_none(absent)


class InstalledManiSkill:
    """The mani_skill package of this Python, found without importing it."""

    name = "mani_skill"
    title = "installed mani_skill"

    def fetch(self, files: Sequence[AssetFile], scratch: Path, *, again: bool) -> Contents:
        """Yield what the package holds; see `AssetSource`."""
        folder = find_mani_skill()
        absent: list[str] = []
        for file in files:
            path = folder / file.origin.mani_skill / file.path
            try:
                data = path.read_bytes()
            except OSError as error:
                absent.append(f"{path} ({error.strerror})")
            else:
                yield file, data
        _expect_none(absent)


class ManiSkillWheel:
    """The wheel of mani_skill, downloaded with the user's own pip and configuration."""

    name = "wheel"
    title = "mani_skill wheel through pip"

    def fetch(self, files: Sequence[AssetFile], scratch: Path, *, again: bool) -> Contents:
        """Download the wheel and yield what it holds; see `AssetSource`."""
        for requirement in sorted({file.origin.wheel for file in files}):
            wanted = [file for file in files if file.origin.wheel == requirement]
            with tempfile.TemporaryDirectory(dir=scratch) as folder:
                wheel = _download_wheel(requirement, Path(folder), use_cache=not again)
                yield from _unpack(wheel, wanted)


def find_mani_skill() -> Path:
    """Return the folder of the installed mani_skill package, without importing it.

    Raises:
        SourceError: If it is not installed.
    """
    spec = find_spec("mani_skill")
    locations = list(spec.submodule_search_locations or ()) if spec is not None else []
    if not locations:
        raise SourceError("mani_skill is not installed")
    return Path(locations[0])


def _expect_none(absent: list[str]) -> None:
    if absent:
        raise SourceError(f"lacks {len(absent)} files: {', '.join(absent)}")


def _unpack(wheel: Path, files: Sequence[AssetFile]) -> Contents:
    absent: list[str] = []
    try:
        with zipfile.ZipFile(wheel) as archive:
            members = set(archive.namelist())
            for file in files:
                member = f"mani_skill/{file.origin.mani_skill}/{file.path}"
                if member in members:
                    yield file, archive.read(member)
                else:
                    absent.append(member)
    except zipfile.BadZipFile as error:
        raise SourceError(f"{wheel.name} is damaged: {error}") from error
    _expect_none(absent)


def _download_wheel(requirement: str, folder: Path, *, use_cache: bool) -> Path:
    command = [
        *_pip_command(),
        "download",
        "--no-deps",
        "--only-binary=:all:",
        "--no-input",
        "--disable-pip-version-check",
        "--retries=2",
        *(() if use_cache else ("--no-cache-dir",)),
        f"--dest={folder}",
        requirement,
    ]
    log = folder / "pip.log"
    say(f"downloading the wheel of {requirement} ({_WHEEL_SIZE_HINT}) with pip")
    with log.open("wb") as output, download_bar(requirement, total=None):
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT, check=False
        )
    wheels = sorted(folder.glob("*.whl"))
    if done.returncode != 0 or not wheels:
        raise SourceError(_last_words(log.read_text(encoding="utf-8", errors="replace")))
    return wheels[0]


def _pip_command() -> list[str]:
    if sys.executable and find_spec("pip") is not None:
        return [sys.executable, "-m", "pip"]
    uv = shutil.which("uv")
    if uv is not None:
        return [uv, "tool", "run", "pip"]
    raise SourceError("this Python has no pip (python -m ensurepip adds it), and there is no uv")


def _last_words(log: str) -> str:
    lines = [line.strip() for line in log.splitlines() if line.strip()]
    errors = [line.removeprefix("ERROR: ") for line in lines if line.startswith("ERROR: ")]
    return "pip failed: " + (errors or lines or ["it said nothing"])[-1]
