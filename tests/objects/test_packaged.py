"""Things of packages: what is known of them without a file, and what their files make of them."""

import json
from dataclasses import replace

import pytest
import trimesh

from objects import ObjectDescriptor, ObjectRegistry
from objects.inspect import fetch
from objects.packaged import MEASURED, PACKAGED, PackagedObject, measurements
from objects.registry import CATALOGUE
from robot_layouts.__main__ import main
from robot_layouts.simulation.checks.objects import try_rests, try_thing_grasps
from robots import DescriptorError, UnknownNameError
from robots.assets.manifest import SourceError, find_package, load_manifest

SINGLE = [name for name, one in PACKAGED.items() if one.members == 1]
PRESSED = {"metaworld_door_lock", "metaworld_window_sideways"}  # no grasp of them holds


def loaded(name: str, seed: int | None = None) -> ObjectDescriptor:
    try:
        find_package(PACKAGED[name].package.removesuffix("_objects"))
    except SourceError as error:
        pytest.skip(str(error))
    return ObjectRegistry.load(name, seed)


def test_eighty_things_have_names_and_twenty_five_have_joints():
    assert ObjectRegistry.packaged() == tuple(sorted(PACKAGED))
    assert not set(PACKAGED) & set(CATALOGUE)
    assert len(CATALOGUE) + len(PACKAGED) >= 80
    assert sum(bool(ObjectRegistry.load(name).joints) for name in CATALOGUE) >= 25


@pytest.mark.parametrize("name", PACKAGED)
def test_the_manifest_has_its_files_with_their_licence(name):
    one = PACKAGED[name]
    package = load_manifest().package(one.package)
    assert one.licence in ("Apache-2.0", "MIT", "Zlib")
    assert name.startswith((package.origin.distribution, "kitchen_"))
    for number in {0, one.members - 1}:
        needed = {f.path for f in package.needed(one.file.format(number), pictures=False)}
        assert one.file.format(number) in needed
        assert any("LICENSE" in path for path in needed)


def test_what_was_measured_is_of_these_things_and_stands():
    assert list(measurements()) == SINGLE
    for name, known in measurements().items():
        assert known["rests"], name
        assert bool(known["grasps"]) != (name in PRESSED), name
    assert MEASURED.read_text() == MEASURED.read_text().strip() + "\n"
    json.loads(MEASURED.read_text())


def test_what_has_no_files_is_listed_with_its_licence(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ROBOT_LAYOUTS_ASSETS", str(tmp_path))
    assert main(["objects", "fetch", "metaworld_mug", "--check"]) == 1
    printed = capsys.readouterr().out
    assert "metaworld_mug: 16 of 16 files, 0.1 MB cannot be used" in printed
    assert "metaworld_objects: licence MIT: object files of metaworld 3.1.1" in printed
    assert main(["objects", "list"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed[-len(PACKAGED) :]] == sorted(PACKAGED)
    assert not any(tmp_path.iterdir())


def test_names_that_are_taken_and_names_that_are_none_are_refused():
    taken = PackagedObject("x", "A thing", "metaworld_objects", "y.obj")
    with pytest.raises(DescriptorError, match="the object 'x' is a single thing; it has no family"):
        taken.load(seed=3)
    with pytest.raises(DescriptorError, match="already called 'metaworld_mug', of a package"):
        ObjectRegistry.register(_renamed("metaworld_mug"))
    with pytest.raises(DescriptorError, match="'metaworld_mug' is a single thing"):
        ObjectRegistry.family("metaworld_mug")
    with pytest.raises(UnknownNameError, match="unknown object of a package 'mug'"):
        fetch(["mug"], check=True)


def _renamed(name: str) -> ObjectDescriptor:
    return replace(ObjectRegistry.load("mug"), name=name)


def test_a_path_is_a_thing_where_names_are(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ROBOT_LAYOUTS_ASSETS", str(tmp_path / "assets"))
    trimesh.creation.box((0.1, 0.04, 0.03)).export(tmp_path / "bar.stl")
    assert main(["objects", "inspect", str(tmp_path / "bar.stl")]) == 0
    assert "bar: A thing from bar.stl" in capsys.readouterr().out
    (tmp_path / "bar.xml").write_text(
        "<mujoco><worldbody><body name='rod'><geom type='box' size='.05 .02 .01'/></body>"
        "</worldbody></mujoco>"
    )
    assert (
        main(["objects", "show", str(tmp_path / "bar.xml"), "--out", str(tmp_path / "a.png")]) == 0
    )


@pytest.mark.long
@pytest.mark.parametrize("name", SINGLE)
def test_it_stands_and_its_grasps_hold(name):
    thing = loaded(name)
    assert isinstance(thing, ObjectDescriptor)
    assert loaded(name) is thing  # its file is read once
    assert thing.licence == PACKAGED[name].licence
    assert [seen.problem for seen in try_rests([thing]) if seen.problem] == []
    tried = try_thing_grasps(thing, 0.1)
    assert sum(one.holds for one in tried) >= 0.95 * len(tried)


@pytest.mark.long
def test_the_thousand_are_a_family():
    one, other = loaded("pybullet_random", 17), loaded("pybullet_random", 1017)
    assert one.parts == other.parts != loaded("pybullet_random").parts
    assert (one.seed, other.seed) == (17, 1017)
    assert one.mass == pytest.approx(0.1)
