"""A URDF is repaired where it is clear how, each repair in words, and else refused."""

from __future__ import annotations

import pytest

from robot_layouts.__main__ import main
from robots import AssetError, RobotRegistry
from robots.from_urdf import guess_descriptor
from robots.registry import CATALOGUE, ROBOTS
from robots.urdf.cleaning.cleaning import clean
from robots.urdf.reading import read_model
from robots.urdf.summary import read_cleaned
from tests.catalogue import is_optional
from tests.robots.damaged_robots import (
    BOX,
    FINE,
    INERTIAL,
    LIMIT,
    REFUSED,
    REPAIRS,
    with_tip,
    with_wrist,
    write_damaged,
)


@pytest.mark.parametrize("kind", REPAIRS)
def test_what_has_a_clear_meaning_is_repaired_and_told(kind, tmp_path):
    text, repairs = REPAIRS[kind]
    urdf = write_damaged(tmp_path, text)
    cleaned = read_cleaned(urdf)
    assert cleaned.repairs == repairs
    assert clean(cleaned.xml, str(urdf)).repairs == ()  # nothing is left to repair
    reasons = guess_descriptor(urdf).reasons
    assert reasons[: len(repairs)] == tuple(f"repaired: {repair}" for repair in repairs)


@pytest.mark.parametrize("kind", FINE)
def test_what_is_fine_keeps_every_byte(kind, tmp_path):
    urdf = write_damaged(tmp_path, FINE[kind])
    cleaned = read_cleaned(urdf)
    assert (cleaned.xml, cleaned.repairs) == (urdf.read_bytes(), ())
    assert guess_descriptor(urdf).descriptor.joints


@pytest.mark.parametrize("kind", REFUSED)
def test_what_has_no_clear_meaning_is_refused(kind, tmp_path):
    text, reason = REFUSED[kind]
    with pytest.raises(AssetError) as error:
        guess_descriptor(write_damaged(tmp_path, text))
    assert reason in str(error.value)


@pytest.mark.long
@pytest.mark.parametrize("robot", [name for name in CATALOGUE if not is_optional(name)])
def test_the_catalogue_needs_no_repair(robot):
    urdf = RobotRegistry.load(robot).urdf.locate()
    cleaned = read_cleaned(urdf)
    assert (cleaned.xml, cleaned.repairs) == (urdf.read_bytes(), ())


def test_a_joint_that_cannot_move_is_fixed_and_one_that_is_planar_stands(tmp_path):
    def types(kind: str) -> dict[str, str]:
        urdf = write_damaged(tmp_path / kind.replace(" ", ""), REPAIRS[kind][0])
        return {j.name: j.type for j in read_model(read_cleaned(urdf).xml, str(urdf)).joints}

    assert types("limits 0 … 0") == {"shoulder": "revolute", "wrist": "fixed"}
    assert types("a planar base") == {"shoulder": "revolute", "floor": "fixed"}


def test_a_box_turns_as_heavily_as_its_mass_and_size_say(tmp_path):
    urdf = write_damaged(tmp_path, REPAIRS["no inertia"][0])
    xml = read_cleaned(urdf).xml.decode()
    xx, yy, zz = (2 / 12 * (a * a + b * b) for a, b in ((0.2, 0.3), (0.1, 0.3), (0.1, 0.2)))
    for key, moment in (("ixx", xx), ("iyy", yy), ("izz", zz)):
        written = float(xml.split(f'{key}="')[-1].split('"')[0])
        assert written == pytest.approx(moment, rel=1e-6)


def test_two_shapes_in_one_collision_are_both_there_where_it_is(tmp_path):
    ball = '<sphere radius="0.1"/>'
    several = f'<collision><origin xyz="1 2 3"/><geometry>{BOX}{ball}</geometry></collision>'
    text = with_tip(INERTIAL + several)
    model = read_model(read_cleaned(write_damaged(tmp_path, text)).xml, "toy.urdf")
    kinds = [found.kind for found in model.collisions["tip"]]
    places = [found.origin[:3, 3].tolist() for found in model.collisions["tip"]]
    assert (kinds, places) == (["box", "sphere"], [[1, 2, 3], [1, 2, 3]])


def test_a_mesh_that_changes_is_looked_at_again(tmp_path):
    urdf = write_damaged(tmp_path, REPAIRS["a flat mesh"][0])
    assert read_cleaned(urdf).repairs
    (urdf.parent / "box.stl").replace(urdf.parent / "flat.stl")
    assert read_cleaned(urdf).repairs == ()


def test_a_repair_shows_in_the_report_on_a_robot(tmp_path, capsys, monkeypatch):
    urdf = write_damaged(tmp_path, REPAIRS["no inertia"][0])
    descriptor = guess_descriptor(urdf, "cleaned_toy").descriptor
    monkeypatch.setattr(ROBOTS, "registered", {"cleaned_toy": descriptor})
    assert main(["robots", "inspect", "cleaned_toy"]) == 0
    assert f"Repaired in the URDF\n  {REPAIRS['no inertia'][1][0]}" in capsys.readouterr().out


def test_a_package_xml_with_entities_names_nothing(tmp_path):
    urdf = write_damaged(tmp_path, REPAIRS["a package of another folder"][0])
    package = urdf.parent.parent / "package.xml"
    package.write_text(
        '<!DOCTYPE p [<!ENTITY a "toy_package">]><package><name>&a;</name></package>'
    )
    with pytest.raises(AssetError, match="files of the package 'toy_package', which is neither"):
        guess_descriptor(urdf)


def test_what_follows_a_fixed_joint_from_afar_is_refused(tmp_path):
    text = with_wrist('<limit lower="0" upper="0"/>').replace(
        LIMIT, LIMIT + '<mimic joint="wrist" offset="0.1"/>', 1
    )
    with pytest.raises(AssetError, match="'shoulder' mimics 'wrist', which is no joint that moves"):
        guess_descriptor(write_damaged(tmp_path, text))
