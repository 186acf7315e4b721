"""A fingerprint is that of the files' contents: not of their place, nor of pictures."""

import shutil

import pytest

from robots import AssetError, LocalUrdf, RobotRegistry
from robots.urdf.summary import asset_fingerprint
from tests.catalogue import is_optional

URDF = RobotRegistry.load("panda").urdf


@pytest.fixture
def copy(tmp_path):
    found = URDF.locate()
    return shutil.copytree(found.parent, tmp_path / "copy") / found.name


def test_the_place_makes_no_difference(copy):
    assert asset_fingerprint(LocalUrdf(copy)) == asset_fingerprint(URDF)


@pytest.mark.parametrize(
    "name", ["panda_v2.urdf", "panda_v2.srdf", "franka_description/meshes/collision/link3.stl"]
)
def test_every_file_that_physics_reads_counts(copy, name):
    before = asset_fingerprint(LocalUrdf(copy))
    with (copy.parent / name).open("ab") as stream:
        stream.write(b"\n")
    assert asset_fingerprint(LocalUrdf(copy)) != before


def test_a_missing_srdf_counts(copy):
    before = asset_fingerprint(LocalUrdf(copy))
    copy.with_suffix(".srdf").unlink()
    assert asset_fingerprint(LocalUrdf(copy)) != before


def test_other_files_do_not_count(copy):
    before = asset_fingerprint(LocalUrdf(copy))
    (copy.parent / "notes.txt").write_text("nothing to do with physics")
    assert asset_fingerprint(LocalUrdf(copy)) == before


OURS = [name for name in RobotRegistry.names() if not is_optional(name)]


@pytest.mark.parametrize(
    "names",
    [
        ("panda", "panda_stick", "so100"),
        pytest.param(OURS, marks=pytest.mark.long),
    ],
    ids=["some", "all"],
)
def test_robots_differ(names):
    urdfs = {RobotRegistry.load(name).urdf for name in names}  # that some robots share
    prints = [asset_fingerprint(urdf) for urdf in urdfs]
    assert len(set(prints)) == len(prints) > len(names) / 2
    assert all(len(text) == 64 for text in prints)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(AssetError, match="cannot read the URDF"):
        asset_fingerprint(LocalUrdf(tmp_path / "no.urdf"))
