"""Every platform that is named has wheels of what the library needs there, says the package index.

Nothing is downloaded: pip is asked what it would install.
"""

from __future__ import annotations

import json
import subprocess
import sys

import pytest
from packaging.requirements import Requirement

from tests.checkout import ROOT

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

PYTHON = "3.12"
EXTRAS = ("checks", "export", "mjcf", "motion", "preview", "view")
# Oldest systems first: glibc's versions, and those of macOS.
PLATFORMS = {
    "linux x86-64": ("Linux", "x86_64", [f"manylinux_2_{k}_x86_64" for k in range(5, 40)]),
    "linux aarch64": ("Linux", "aarch64", [f"manylinux_2_{k}_aarch64" for k in range(17, 40)]),
    "macOS arm64": (
        "Darwin",
        "arm64",
        [f"macosx_{k}_0_{kind}" for k in range(11, 16) for kind in ("arm64", "universal2")],
    ),
    "Windows": ("Windows", "AMD64", ["win_amd64"]),
}
LACKING = {"linux aarch64": {"sapien", "toppra"}, "macOS arm64": {"toppra"}}
LACKING["Windows"] = {"toppra", "ompl"}


def needed(system: str, machine: str) -> list[Requirement]:
    """Return what the library and some extras need on a platform."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    texts = [*project["dependencies"], *(text for extra in EXTRAS for text in extras[extra])]
    there = {
        "platform_system": system,
        "platform_machine": machine,
        "python_version": PYTHON,
        "extra": "",
    }
    found = [Requirement(text) for text in texts]
    return [
        one
        for one in found
        if one.name != "robot-layouts" and (one.marker is None or one.marker.evaluate(there))
    ]


@pytest.mark.parametrize("name", PLATFORMS)
def test_what_a_platform_lacks_is_not_asked_for_there(name):
    here = {one.name for one in needed("Linux", "x86_64")}
    there = {one.name for one in needed(*PLATFORMS[name][:2])}
    assert here - there == LACKING.get(name, set())


@pytest.mark.long
@pytest.mark.parametrize("name", PLATFORMS)
def test_the_index_has_wheels(name, tmp_path):
    system, machine, tags = PLATFORMS[name]
    report = tmp_path / "report.json"
    asked = [f"{one.name}{one.specifier}" for one in needed(system, machine)]
    command = [
        *(sys.executable, "-m", "pip", "install", "--dry-run", "--no-deps", "--quiet"),
        *("--only-binary=:all:", "--python-version", PYTHON, "--report", str(report)),
        *("--target", str(tmp_path / "nowhere")),
        *(word for tag in tags for word in ("--platform", tag)),
        *asked,
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "connection" in done.stderr.lower():
        pytest.skip("the package index cannot be reached")
    assert done.returncode == 0, done.stderr
    found = json.loads(report.read_text(encoding="utf-8"))["install"]
    assert len(found) == len({*asked})
