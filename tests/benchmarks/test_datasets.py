"""Recordings of cells are certified, and their recipes make them again."""

import json

import pytest

from benchmarks.__main__ import main
from robot_layouts.__main__ import main as command

TASK = "CellPressTogether-v1"


@pytest.mark.long
def test_a_cell_is_certified_and_its_recipe_makes_it_again(tmp_path, capsys):
    out, work = tmp_path / "sets.json", tmp_path / "work"
    made = ["datasets", "--tasks", TASK, "--episodes", "2", "--work", str(work), "--out", str(out)]
    assert main(made) == 0
    seen = json.loads(out.read_text())["tasks"][TASK]
    assert seen["recorded"] == 2
    assert (seen["episodes"], seen["solved"], seen["equal"], seen["touching"]) == (2, 2, 2, 0)
    assert seen["seconds"] > 0
    assert not (work / TASK).exists()
    assert "| [CellPressTogether](sets/CellPressTogether.yaml) | 2 of 2 | 2 of 2 | 0 |" in (
        out.with_suffix(".md").read_text()
    )
    written = out.read_bytes()
    assert main(made) == 0  # what is in the record is not recorded again
    assert out.read_bytes() == written
    recipe = tmp_path / "sets" / "CellPressTogether.yaml"
    capsys.readouterr()
    assert command(["data", "build", str(recipe), "--out", str(tmp_path / "again")]) == 0
    assert "every file is that of the recipe, to the last bit" in capsys.readouterr().out
    recipe.write_text(recipe.read_text().replace("seeds: 0-1", "seeds: 1-2"))
    assert command(["data", "build", str(recipe), "--out", str(tmp_path / "others")]) == 1
