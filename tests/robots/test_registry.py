"""The registry: look-ups, registrations, robots of other packages, and its errors."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from robots import DescriptorError, RobotRegistry, UnknownNameError, closest_match
from robots.registry import CATALOGUE, ROBOTS

CHECKOUT = Path(__file__).parents[2]


@pytest.fixture(autouse=True)
def _own_registrations(monkeypatch):
    monkeypatch.setattr(ROBOTS, "registered", {})


def test_loading_twice_gives_the_same_robot():
    assert RobotRegistry.load("panda") is RobotRegistry.load("panda")


def test_an_unknown_name_is_a_key_error_with_the_closest_match_and_the_choices():
    with pytest.raises(KeyError) as error:
        RobotRegistry.load("Panda_Stik")
    assert isinstance(error.value, UnknownNameError)
    assert str(error.value) == (
        "unknown robot 'Panda_Stik'. Did you mean 'panda_stick'?"
        f" The closest of {len(CATALOGUE)}: panda_stick, panda_wristcam, panda_pinch, panda,"
        " mobile_panda."
        " `robot-layouts robots list` has all; RobotRegistry.register(descriptor) adds your own."
    )
    assert error.value.choices == tuple(CATALOGUE)
    with pytest.raises(UnknownNameError, match="^unknown robot 'qqq'. `robot-layouts robots list`"):
        RobotRegistry.load("qqq")


def test_the_closest_match_ignores_case_and_keeps_its_own():
    assert closest_match("Panda", ["gripper", "PANDA"]) == "PANDA"
    assert closest_match("xyz", ["gripper", "PANDA"]) is None


def test_a_registered_robot_is_found_and_listed_in_order():
    mine = replace(RobotRegistry.load("panda"), name="my_panda", reach=0.7)
    assert RobotRegistry.register(mine) is mine
    assert RobotRegistry.load("my_panda") is mine
    assert RobotRegistry.names() == tuple(sorted([*CATALOGUE, "my_panda"]))
    assert RobotRegistry.register(replace(mine)) == mine


@pytest.mark.parametrize("name", ["panda", "my_panda"])
def test_a_second_robot_of_the_same_name_is_refused(name):
    RobotRegistry.register(replace(RobotRegistry.load("panda"), name="my_panda"))
    other = replace(RobotRegistry.load("panda"), name=name, reach=2.0)
    with pytest.raises(DescriptorError, match=f"another robot is already called '{name}'"):
        RobotRegistry.register(other)


def test_only_descriptors_are_registered():
    with pytest.raises(DescriptorError, match="register gave 'panda', of type str; a Robot"):
        RobotRegistry.register("panda")  # type: ignore[arg-type]


@pytest.fixture
def other_package(tmp_path) -> Path:
    """An installed package that brings robots through entry points."""
    (tmp_path / "acme.py").write_text(
        "from dataclasses import replace\n"
        "from robots import RobotRegistry\n"
        "ARM = replace(RobotRegistry.load('panda'), name='acme_arm', source='acme')\n"
        "NONSENSE = 42\n"
    )
    info = tmp_path / "acme-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[robot_layouts.robots]\nacme_arm = acme:ARM\nacme_nonsense = acme:NONSENSE\n"
    )
    return tmp_path


def run_with(other_package: Path, code: str) -> str:
    environment = {**os.environ, "PYTHONPATH": f"{other_package}{os.pathsep}{CHECKOUT}"}
    return subprocess.run(
        [sys.executable, "-c", f"from robots import RobotRegistry\n{code}"],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    ).stdout


def test_another_package_brings_a_robot(other_package):
    code = "print(RobotRegistry.load('acme_arm').source, *RobotRegistry.names())"
    names = sorted([*CATALOGUE, "acme_arm", "acme_nonsense"])
    assert run_with(other_package, code) == f"acme {' '.join(names)}\n"


def add_to(other_package: Path, entry_point: str, module: str = "") -> None:
    """Let the other package bring one robot more."""
    with (other_package / "acme-1.0.dist-info" / "entry_points.txt").open("a") as lines:
        lines.write(f"{entry_point}\n")
    (other_package / "broken.py").write_text(module)


@pytest.mark.parametrize(
    ("entry_point", "module", "reason"),
    [
        ("bad = broken:ARM", "raise RuntimeError('no GPU')", "RuntimeError: no GPU"),
        ("bad = acme:ARM", "", "is listed as 'bad', but its robot is 'acme_arm'"),
    ],
)
def test_a_robot_that_cannot_be_loaded_is_named_and_leaves_the_others_alone(
    other_package, entry_point, module, reason
):
    add_to(other_package, entry_point, module)
    printed = run_with(
        other_package,
        "from robots import DescriptorError\n"
        "assert RobotRegistry.load('acme_arm').source == 'acme'\n"
        "assert 'bad' in RobotRegistry.names()\n"
        "try: RobotRegistry.load('bad')\n"
        "except DescriptorError as error: print(error)\n"
        "robots, failures = RobotRegistry.load_all()\n"
        "print(len(robots), len(failures))\n",
    )
    error, counts = printed.splitlines()
    assert reason in error
    assert counts == f"{len(CATALOGUE) + 1} 2"  # acme_nonsense, too


@pytest.mark.long
@pytest.mark.parametrize("command", ["robots list", "robots fetch --check"])
def test_commands_for_all_robots_name_those_that_cannot_be_loaded(other_package, command):
    done = subprocess.run(
        [sys.executable, "-c", "from robot_layouts.__main__ import run; run()", *command.split()],
        env={**os.environ, "PYTHONPATH": f"{other_package}{os.pathsep}{CHECKOUT}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "acme_arm" in done.stdout
    assert "panda_stick" in done.stdout
    assert done.stderr.startswith("error: entry point 'acme:NONSENSE' of acme 1.0 gave 42")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("name", [None, 5, ["panda"], {}])
def test_a_name_that_is_no_text_is_unknown(name):
    with pytest.raises(UnknownNameError, match=f"of type {type(name).__name__}"):
        RobotRegistry.load(name)
