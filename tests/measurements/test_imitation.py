"""What is kept of runs of imitation."""

import json

import pytest

pytest.importorskip("matplotlib")

from measurements.imitation import PAGE

RUN = {
    "recipe": {"task": "PushCube-v1", "episodes": 3, "steps": 20, "batch": 4},
    "test_seeds": [1_000_000, 1_000_003],
    "success": 0.75,
    "failed": [1_000_002],
    "curve": [
        {"steps": 10, "error": 0.5, "success": 0.5},
        {"steps": 20, "error": 0.4, "success": 1},
    ],
}


def test_a_run_is_added_and_takes_the_place_of_an_older_one(tmp_path):
    out, run = tmp_path / "record.json", tmp_path / "run"
    run.mkdir()
    seen = {**RUN, "recipe": {**RUN["recipe"], "size": 96}}
    for found in (RUN, seen, {**seen, "success": 1.0, "failed": []}):
        (run / "learning_curve.json").write_text(json.dumps(found))
        assert PAGE.main([str(run), "--out", str(out)]) == 0
    rows = (tmp_path / "record.md").read_text().splitlines()
    assert "| PushCube-v1 | 3 | 20 of 4 | 4 | 75 (30.1 to 95.4) | 1000002 |" in rows
    assert "| PushCube-v1, from pictures | 3 | 20 of 4 | 4 | 100 (51.0 to 100.0) | none |" in rows
    assert (tmp_path / "record.png").read_bytes().startswith(b"\x89PNG")


def test_a_folder_without_a_run(tmp_path, capsys):
    assert PAGE.main([str(tmp_path), "--out", str(tmp_path / "record.json")]) == 1
    assert "learning_curve.json cannot be read" in capsys.readouterr().err
    assert not (tmp_path / "record.json").exists()
