"""Brings robot files into the local copy: from each source in turn, checking every file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from robot_layouts.core.errors import AssetError
from robot_layouts.core.paths import default_root
from robots.assets.manifest import INDEX_PACKAGES, AssetFile, SourceError, load_manifest
from robots.assets.sources import AssetSource, HubSource, InstalledPackage, PackageWheel
from robots.assets.store import AssetStore, FileState, listing, say, size


def locate(package: str, urdf: str, *, pictures: bool) -> Path:
    """Return a URDF of the local copy, fetching what it needs if that is not there.

    Raises:
        UnknownNameError: If the manifest has no such package or URDF.
        AssetError: If no source has some file, or pictures are asked for of a
            URDF whose visual meshes are not published.
    """
    about = load_manifest().package(package)
    files = about.needed(urdf, pictures=pictures)
    if pictures and urdf in about.undrawable:
        raise AssetError(
            f"{package}/{urdf} cannot be drawn, as {about.origin.wheel} lacks some of its visual"
            " meshes; without pictures it can be simulated"
        )
    store = AssetStore(default_root())
    ensure(files, store, default_sources())
    return store.path(about.file(urdf))


def locate_file(package: str, path: str) -> Path:
    """Return one file of the local copy, fetching its package if something of that is not there.

    Raises:
        UnknownNameError: If the manifest has no such package or file.
        AssetError: If no source has it.
    """
    about = load_manifest().package(package)
    file, store = about.file(path), AssetStore(default_root())
    ensure(about.files, store, default_sources())
    return store.path(file)


def default_sources(*, offline: bool = False, revision: str | None = None) -> list[AssetSource]:
    """Return the sources after the local copy, in the order in which they are tried.

    Args:
        offline: Whether to leave out those that use the network.
        revision: Revision of the Hub's dataset, if not the default.
    """
    installed = [InstalledPackage(package) for package in INDEX_PACKAGES]
    if offline:
        return [*installed]
    wheels = [PackageWheel(package) for package in INDEX_PACKAGES]
    return [HubSource(revision=revision), *installed, *wheels]


def ensure(files: Sequence[AssetFile], store: AssetStore, sources: Sequence[AssetSource]) -> None:
    """Make files usable in the local copy; does nothing if they are.

    Args:
        files: What is needed.
        store: The local copy.
        sources: Where to look, in order.

    Raises:
        AssetError: If no source has some file, or it cannot be written; names every source tried.
    """
    if not store.unusable(files):
        return
    with store.fetching() as scratch:
        wanted = store.unusable(files)  # another process may have fetched them meanwhile
        for origin in {file.origin: None for file in wanted}:
            total = sum(file.bytes for file in wanted if file.origin == origin)
            say(f"fetching {origin.name} ({size(total)})")
            say(f"licence {origin.licence}: {origin.licence_note}")
        failures: list[str] = []
        for source in sources:
            asked = [file for file in wanted if source.holds(file)]
            if not asked:
                continue
            fetch = _Fetch(source, store, scratch)
            failure = fetch.run(asked)
            if fetch.kept:
                command = "`robot-layouts robots fetch --check` lists it, with licences"
                say(f"kept what came along of {len(fetch.kept)} packages; {command}")
            missing = store.unusable(asked)
            outcome = f"{len(asked) - len(missing)} of {len(asked)} files"
            shown = f"{failure[:160]} …" if len(failure) > 160 else failure
            say(f"{source.title}: {outcome}" + (f"; {shown}" if shown else ""))
            failures.append(f"{source.title}: {failure}")
            wanted = store.unusable(wanted)
        if wanted:
            raise AssetError(_failure_text(wanted, store, failures))


@dataclass
class _Fetch:
    """One attempt to get files from one source."""

    source: AssetSource
    store: AssetStore
    scratch: Path
    kept: set[str] = field(default_factory=set[str])  # packages of which files came along
    room: bool = True

    def run(self, files: Sequence[AssetFile]) -> str:
        """Fetch, refetch once what differs, and return why something is still missing."""
        try:
            different = self._install(files, again=False)
            if different:
                different = self._install(different, again=True)
        except SourceError as error:
            return str(error)
        if not different:
            return ""
        return (
            f"refused, as {len(different)} files differ from the manifest, twice:"
            f" {listing([str(file) for file in different])}"
        )

    def _install(self, files: Sequence[AssetFile], *, again: bool) -> list[AssetFile]:
        """Install what the source gives, and return what differs from the manifest."""
        different: list[AssetFile] = []
        asked = set(files)
        for file, data in self.source.fetch(files, self.scratch, again=again):
            if file not in asked:
                self._keep(file, data)
            elif not self.store.install(file, data, scratch=self.scratch):
                different.append(file)
        return different

    def _keep(self, file: AssetFile, data: bytes) -> None:
        """Keep a file that came along with another, so that it need not be fetched later."""
        try:
            if self.room and self.store.state(file) is FileState.MISSING:
                if self.store.install(file, data, scratch=self.scratch):
                    self.kept.add(file.origin.name)
        except AssetError as error:  # what was asked for is there
            self.room = False
            say(f"{error} What came along is not kept.")


def _failure_text(wanted: list[AssetFile], store: AssetStore, failures: list[str]) -> str:
    states = listing([f"{file}: {store.state(file).value}" for file in wanted], "\n    ")
    tried = "".join(f"\n    {failure}" for failure in failures) or "\n    none"
    wheels = " ".join(sorted({file.origin.wheel for file in wanted}))
    return (
        f"{len(wanted)} robot files cannot be used in {store.root}\n"
        f"  sources tried:{tried}\n"
        f"  files:\n    {states}\n"
        f"  what to do: connect to the network and run `robot-layouts robots fetch`, or"
        f" `pip install {wheels}`, or copy the files into {store.root} from another machine"
    )
