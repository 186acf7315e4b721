"""``python -m benchmarks robots``: what is tried, judged and kept; a crash is a result."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path

import pytest

from benchmarks.__main__ import main
from benchmarks.robots import survey as survey_module
from benchmarks.robots.judge import EXPECTED, expected_of, read_expectations
from benchmarks.robots.survey import Robot, probe
from tests.three_links import arm, save

RECORD = Path(__file__).parents[2] / "docs" / "robots.json"


def loaded(**groups: tuple[tuple[str, ...], int]) -> dict:
    """Return what a probe sees of a robot's shape, and of nothing else."""
    return {
        "loads": {
            "groups": {n: {"joints": list(j), "numbers": size} for n, (j, size) in groups.items()},
            "tcp": "tool",
            "tips": [],
            "reach": 0.9,
        },
        "trial": {"stands": True, "exploded": None, "numbers": 2, "wrong_numbers": []},
    }


@pytest.fixture
def quick_probe(tmp_path, monkeypatch):
    """Have processes run another program than the probe; called with the program."""

    def use(program: str) -> None:
        (tmp_path / "quick_probe.py").write_text(program)

    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setattr(survey_module, "PROBE", "quick_probe")
    return use


def seeing(seen: dict) -> str:
    return f"print({json.dumps(seen)!r}, flush=True)"


class TestProbe:
    @pytest.mark.parametrize(
        ("program", "ended"),
        [
            ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", "crashed: SIGSEGV"),
            ("import sys; sys.exit('out of luck')", "ended with 1: out of luck"),
        ],
    )
    def test_one_that_crashes_keeps_what_was_seen(self, tmp_path, quick_probe, program, ended):
        save(tmp_path, arm())
        quick_probe(f"{seeing({'loads': {}})}\n{program}")
        seen = probe(Robot("mine", "small.urdf", tmp_path), 60.0)
        made = version("robot-layouts")
        assert seen == {"made_with": made, "missing": [], "loads": {}, "ended": ended}


class TestExpectations:
    def test_every_robot_of_the_record_is_known_with_its_joints(self):
        expectations = read_expectations(EXPECTED)
        for key, seen in json.loads(RECORD.read_text())["robots"].items():
            expected = expected_of(key, expectations)
            assert expected.kind != "unknown", key
            groups = seen.get("loads", {}).get("groups", {})
            joints = [joint for group in groups.values() for joint in group["joints"]]
            for limb in expected.arms.values() if joints else ():
                for pattern in (*limb.joints, *limb.gripper):
                    assert any(Path(joint).match(pattern) for joint in joints), (key, pattern)


def test_the_command_resumes_and_writes_the_page(tmp_path, quick_probe):
    folder, out = tmp_path / "robots", tmp_path / "seen.json"
    folder.mkdir()
    save(folder, arm(), "one.urdf")
    command = ["robots", f"mine={folder}", "--out", str(out), "--resume", "--workers", "2"]
    quick_probe(seeing(loaded(arm=(("j1",), 1))))
    assert main([*command, "--only", "*/one.urdf"]) == 0
    quick_probe(seeing({"loads": {"refused": "no longer"}}))
    save(folder, arm(), "two.urdf")
    assert main(command) == 0
    robots = json.loads(out.read_text())["robots"]
    assert list(robots) == ["mine/one.urdf", "mine/two.urdf"]
    assert robots["mine/one.urdf"]["trial"]["stands"]
    assert robots["mine/two.urdf"]["loads"] == {"refused": "no longer"}
    page = out.with_suffix(".md").read_text()
    assert "## Unknown (2)" in page
    assert "| `mine/one.urdf` | yes |" in page
    assert "- `mine/two.urdf`: loads: no longer" in page
