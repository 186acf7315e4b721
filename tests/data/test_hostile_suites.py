"""Suites and runs of somebody else: looking at them runs nothing, and reads nothing but them."""

import os
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from layouts import single
from robot_layouts import __main__ as console
from robot_layouts.data.suite.run import receipt_path
from robot_layouts.data.suite.suite import Case, Suite, load_suite
from robots import TaskError
from tasks.registry import TASKS
from tests.data.policies import TASK
from tests.data.suites import made_run, written

STRANGE = """
from pathlib import Path

from tasks import register_task
from tasks.maniskill.push_t import PushT

Path("ran").touch()

@register_task("ShortPush-v1")
class ShortPush(PushT):
    max_episode_steps = 2
"""
OWN = "name: x\nseeds: 1\ntasks: [strange:ShortPush-v1]"
SHARED = "name: x\nseeds: 1\ntasks: [{{task: PickCube-v1, layout: {}}}]"


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A folder of a stranger's, with a module, to which somebody has gone."""
    (tmp_path / "strange.py").write_text(STRANGE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield tmp_path
    sys.modules.pop("strange", None)
    TASKS.registered.pop("ShortPush-v1", None)


def _expect_untouched() -> None:
    assert "strange" not in sys.modules
    assert not Path("ran").exists()


@pytest.mark.parametrize(
    "layout",
    [
        "{robots: {arm: {robot: 'strange:ROBOT'}}}",
        "{preset: single, robots: {arm: ./arm.xacro}}",
        "cell.yaml",
    ],
)
def test_no_robot_is_imported_or_read_because_a_suite_names_it(folder, layout):
    template = """<robot xmlns:xacro="http://ros.org/wiki/xacro" name="arm">
        <xacro:if value="1"><link name="${open('ran', 'w')}"/></xacro:if></robot>"""
    (folder / "arm.xacro").write_text(template)
    (folder / "cell.yaml").write_text("version: 1\nrobots: {arm: {robot: 'strange:ROBOT'}}")
    with pytest.raises(TaskError, match="and a file chooses no code that runs"):
        load_suite(written(folder, SHARED.format(layout)))
    _expect_untouched()


def test_a_task_of_ones_own_is_imported_by_the_word_of_its_user(folder, capsys):
    """It runs; to look at a run, its task has to be named again."""
    (folder / "suite.yaml").write_text(OWN)
    words = ["--policy=tests.data.policies:still", "--workers=0"]
    assert console.main(["suite", "run", "suite.yaml", "--out=run", *words]) == 0
    sys.modules.pop("strange")
    TASKS.registered.pop("ShortPush-v1")
    assert console.main(["suite", "verify", "run", *words]) == 1
    assert "strange" not in sys.modules
    capsys.readouterr()
    named = "--task=strange:ShortPush-v1"
    assert console.main(["suite", "verify", "run", named, *words]) == 0
    assert "1 of 1 receipts verified" in capsys.readouterr().out
    assert console.main(["suite", "show", "suite.yaml", named]) == 0
    assert console.main(["suite", "report", "run", named, "--workers=0"]) == 0


def test_no_policy_is_imported_because_a_run_names_it(folder, capsys):
    suite = Suite("x", (Case(TASK, (0,)), Case("PickCube-v1", (0,)), Case("PushCube-v1", (0,))))
    run = made_run(folder / "run", suite, {case.name: [0] for case in suite.cases})
    for case, name in zip(suite.cases, ("strange:policy", "strange:other; ls", "x"), strict=True):
        policy = {"kind": "policy", "name": name, "sha256": None, "importable": True}
        if name == "x":
            policy["kind"] = "expert"
        changed = replace(run.receipts[case.name], policy=policy)
        changed.write(receipt_path(folder / "run", case))
    assert console.main(["suite", "verify", "run", "--workers=0"]) == 1
    _expect_untouched()
    assert capsys.readouterr().err == (
        "error: a run does not choose which code runs; to play the policies of PushT-v1 and"
        " PickCube-v1 that are here, type: --policy PushT-v1=strange:policy"
        " 'PickCube-v1=strange:other; ls'\n"
    )
    assert console.main(["suite", "report", "run", "--workers=0"]) == 1
    _expect_untouched()
    assert capsys.readouterr().out.startswith("not listed: run, PushCube-v1\n")


def test_what_lies_below_a_suites_folder_is_read(folder):
    (folder / "cells").mkdir()
    layout = single({"arm": "panda_wristcam"})
    layout.save(folder / "cells" / "one.yaml")
    (folder / "two.yaml").symlink_to(folder / "cells" / "one.yaml")
    os.symlink(folder, folder / "also")
    for path in ("cells/one.yaml", "two.yaml", "cells/../two.yaml"):
        for beside in (folder, folder / "also"):
            suite = load_suite(written(beside, SHARED.format(path)))
            assert suite.cases[0].layout == layout
