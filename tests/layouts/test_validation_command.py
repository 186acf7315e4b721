"""``python -m layouts validate``: the report, the picture, the exit status."""

import pytest

from layouts import side_by_side
from layouts.__main__ import main

PANDAS = "side_by_side left=panda right=panda --spacing"


def run(words, capsys):
    status = main(["validate", *words.split()])
    output = capsys.readouterr()
    return status, output.out, output.err


def test_it_prints_the_report_of_the_layout(capsys):
    status, out, err = run(f"{PANDAS} 0.3 --samples 5 --seed 3 --tabletop -1 -1 1 1", capsys)
    layout = side_by_side({"left": "panda", "right": "panda"}, spacing=0.3)
    report = layout.validate(samples=5, seed=3, table=(-1, -1, 1, 1))
    assert (status, out, err) == (0, f"{report}\n", "")


def test_a_layout_that_collides_is_told_by_the_exit_status(capsys):
    status, out, _ = run(f"{PANDAS} 0.1", capsys)
    assert status == 1
    assert "left.panda_link2 with right.panda_link1" in out


def test_targets_have_names_or_numbers(capsys):
    words = "single arm=panda --target cube=-0.2,0,0.1 --target 3,0,0 --target=-0.2,0,0.1,0,1,0,0"
    status, out, _ = run(words, capsys)
    assert status == 1
    assert "cube (-0.2, 0, 0.1): arm reaches it" in out
    assert "target 2 (3, 0, 0): arm stays" in out
    assert "target 3 (-0.2, 0, 0.1): arm reaches it" in out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("single arm=panda --target a,b,c", "'a,b,c' should be name=x,y,z in metres"),
        ("single arm=panda --target 1,2", "target 'target 1' is (1.0, 2.0); it takes x, y, z"),
        ("single arm=panda --target a=1,2,3 --target a=1,2,3", "target 'a' is given twice"),
        ("single arm=panda --tabletop 1 1 0 0", "it must be x_min, y_min, x_max, y_max"),
        ("single arm=panda --samples -3", "samples is -3"),
        ("single arm=pandas", "Did you mean 'panda'?"),
    ],
)
def test_an_error_is_one_line(words, message, capsys):
    status, _, err = run(words, capsys)
    assert status == (2 if "unknown" in err else 1)
    assert err.startswith("error: ")
    assert message in err
    assert err.count("\n") == 1
