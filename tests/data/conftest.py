"""What tests of several modules ask for."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.data.writable_hub import WritableHub, running_hub


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of half a megabyte, as one process per test may mount it."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=512k", "none", str(place)]
    if subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("file systems cannot be mounted here")
    yield place
    subprocess.run(["umount", str(place)], check=True)


@pytest.fixture
def hub(tmp_path: Path) -> Iterator[WritableHub]:
    """A Hub on this machine that this process finds."""
    with running_hub(tmp_path) as server:
        yield server
