"""The registry of things: look-ups, registrations, things of other packages, and its errors."""

import os
import subprocess
import sys
from dataclasses import replace

import pytest

from objects import ObjectRegistry
from objects.registry import CATALOGUE, OBJECTS
from robots import DescriptorError, UnknownNameError
from tests.checkout import ROOT


@pytest.fixture(autouse=True)
def _own_registrations(monkeypatch):
    monkeypatch.setattr(OBJECTS, "registered", {})


def test_loading_twice_gives_the_same_thing():
    assert ObjectRegistry.load("hammer") is ObjectRegistry.load("hammer")
    assert ObjectRegistry.names() == tuple(CATALOGUE)
    things, failures = ObjectRegistry.load_all()
    assert [thing.name for thing in things] == list(CATALOGUE)
    assert failures == []


def test_an_unknown_name_is_a_key_error_with_the_closest_match():
    with pytest.raises(KeyError) as error:
        ObjectRegistry.load("Hamer")
    assert isinstance(error.value, UnknownNameError)
    assert str(error.value).startswith("unknown object 'Hamer'. Did you mean 'hammer'?")
    assert str(error.value).endswith("ObjectRegistry.register(descriptor) adds your own.")


@pytest.mark.parametrize("name", [None, 5, ["mug"]])
def test_a_name_that_is_no_text_is_unknown(name):
    with pytest.raises(UnknownNameError, match=f"of type {type(name).__name__}"):
        ObjectRegistry.load(name)


def test_a_registered_thing_is_found_and_has_no_members():
    mine = replace(ObjectRegistry.load("mug"), name="my_mug")
    assert ObjectRegistry.register(mine) is mine
    assert ObjectRegistry.load("my_mug") is mine
    assert ObjectRegistry.register(replace(mine)) == mine
    with pytest.raises(DescriptorError, match="the object 'my_mug' is a single thing; it has no f"):
        ObjectRegistry.load("my_mug", seed=3)


def test_a_second_thing_of_the_same_name_is_refused():
    with pytest.raises(DescriptorError, match="another object is already called 'mug'"):
        ObjectRegistry.register(replace(ObjectRegistry.load("cup"), name="mug"))
    with pytest.raises(DescriptorError, match="register gave 'mug', of type str; an ObjectDescr"):
        ObjectRegistry.register("mug")  # type: ignore[arg-type]


def test_another_package_brings_things(tmp_path):
    (tmp_path / "acme.py").write_text(
        "from dataclasses import replace\n"
        "from objects import ObjectRegistry\n"
        "CUP = replace(ObjectRegistry.load('cup'), name='acme_cup', source='acme')\n"
        "NONSENSE = 42\n"
    )
    info = tmp_path / "acme-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[robot_layouts.objects]\nacme_cup = acme:CUP\nacme_nonsense = acme:NONSENSE\n"
    )
    code = (
        "from objects import ObjectRegistry\n"
        "print(ObjectRegistry.load('acme_cup').source)\n"
        "things, failures = ObjectRegistry.load_all()\n"
        "print(len(things))\n"
        "print(*failures)\n"
    )
    printed = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    source, count, failure = printed.splitlines()
    assert source == "acme"
    assert int(count) == len(CATALOGUE) + 1
    assert failure.startswith("entry point 'acme:NONSENSE' of acme 1.0 gave 42, of type int; an O")


def test_importing_and_loading_loads_no_simulator_and_reads_no_file_of_anyone():
    code = (
        "import sys\n"
        "import objects\n"
        "light = [m for m in ('numpy', 'trimesh', 'sapien', 'torch') if m in sys.modules]\n"
        "for name in objects.ObjectRegistry.names():\n"
        "    objects.ObjectRegistry.load(name).mass\n"
        "heavy = [m for m in ('trimesh', 'sapien', 'torch', 'scipy') if m in sys.modules]\n"
        "print(light, heavy)\n"
    )
    printed = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    assert printed == "[] []\n"
