"""``python -m parity inventory``: what it says about tasks here, and about native's own tasks."""

import json
from types import SimpleNamespace

import pytest

from parity.__main__ import main
from parity.inventory import NO_REASON, REASONS, missing_tasks, reason
from parity.native import native_tasks
from tests.native import NATIVE
from tests.parity.test_episodes import demonstration


@pytest.fixture
def printed(tmp_path, capsys):
    record, compared = tmp_path / "results.json", {"PickCube-v1": {"episodes": 7, "equal": False}}
    record.write_text(json.dumps({"versions": {}, "machine": "", "tasks": compared}))
    demonstration(tmp_path / "demos")
    words = ("--demos", str(tmp_path / "demos"), "--results", str(record))
    assert main(["inventory", *words]) == 0
    return capsys.readouterr().out


def test_every_task_has_a_row(printed):
    rows = {line.split()[0]: line for line in printed.splitlines() if "-v1 " in line}
    assert "DIFFERS, 7 episodes" in rows["PickCube-v1"]
    assert rows["PickCube-v1"].split()[-1] == "1"
    assert "never compared" in rows["TwoRobotPickCube-v1"]
    assert "no clone" in rows["Relay-v1"]


def spec(*robots, files=()):
    return SimpleNamespace(
        asset_download_ids=list(files), cls=SimpleNamespace(SUPPORTED_ROBOTS=robots)
    )


@pytest.mark.parametrize(
    ("task_id", "about", "why"),
    [
        ("MS-AntRun-v1", spec(), REASONS["MS-"]),
        ("New-v1", spec("panda", files=["ycb"]), "needs files that native downloads: ycb"),
        (
            "New-v1",
            spec("anymal", ("spot", "spot")),
            "no descriptor here of its robot: anymal, spo",
        ),
        ("New-v1", spec("panda", "anymal"), NO_REASON),
    ],
)
def test_reasons(task_id, about, why):
    assert reason(task_id, about).startswith(why)


class TestNative:
    pytestmark = NATIVE

    def test_native_s_tasks_without_a_clone(self):
        missing, everything = missing_tasks(), native_tasks()
        assert "PickCube-v1" not in missing
        assert len(missing) > 20
        used = [b for b in REASONS if any(task_id.startswith(b) for task_id in everything)]
        assert used == list(REASONS), "each reason is of a task that native has"
