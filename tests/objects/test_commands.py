"""`robot-layouts objects`: the list, what it prints of one, and pictures."""

import matplotlib.image
import numpy as np
import pytest

from objects import ObjectRegistry
from objects.inspect import report
from objects.picture import draw, save_sheet
from objects.registry import CATALOGUE
from robot_layouts.__main__ import main
from robots import DescriptorError


def test_the_list_has_a_line_for_each(capsys):
    assert main(["objects", "list"]) == 0
    head, *lines = capsys.readouterr().out.splitlines()
    assert head.split()[0] == "object"
    assert [line.split()[0] for line in lines[: len(CATALOGUE)]] == list(CATALOGUE)
    (mug,) = [line for line in lines if line.startswith("mug ")]
    assert "11.4 × 8 × 9.5" in mug
    assert "A mug with a handle" in mug


def test_a_report_says_everything_of_a_member():
    text = report(ObjectRegistry.load("jug", seed=3))
    jug = ObjectRegistry.load("jug", seed=3)
    assert text.startswith("jug: A jug with a handle and a spout, the member of seed 3\n")
    for piece in (
        f"mass           {jug.mass:.3g} kg",
        f"radius         {jug.sizes['radius']:g} m",
        "spout ",
        "handle: 24, 12 mm wide",
        "16 ConvexHull",
        "950 kg/m³, friction 0.4",
        "upright: its origin 0 m above the table",
    ):
        assert piece in text, piece


def test_a_picture_shows_every_thing_that_was_named(tmp_path, capsys):
    out = tmp_path / "sheet.png"
    assert main(["objects", "show", "mug", "tray", "--out", str(out), "--seed", "2"]) == 0
    assert capsys.readouterr().out == f"picture: {out}\n"
    picture = matplotlib.image.imread(out)[..., :3]
    left, right = np.array_split(picture, 2, axis=1)
    for half in (left, right):
        assert 0.05 < (half.min(axis=-1) < 0.9).mean() < 0.8
    assert len(draw([ObjectRegistry.load(name) for name in CATALOGUE]).axes) == len(CATALOGUE)


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["show", "mugg", "--out", "a.png"], 2, "error: unknown object 'mugg'. Did you mean 'mug'"),
        (["show", "mug", "--out", "a.gif"], 1, "error: cannot save a picture as 'a.gif'; the name"),
        (["inspect", "hamer"], 2, "error: unknown object 'hamer'. Did you mean 'hammer'?"),
    ],
)
def test_a_mistake_is_named_and_leaves_nothing(words, code, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["objects", *words]) == code
    assert capsys.readouterr().err.startswith(message)
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_no_picture(tmp_path):
    with pytest.raises(DescriptorError, match="there is nothing to draw; name one object or more"):
        save_sheet([], tmp_path / "a.png")
