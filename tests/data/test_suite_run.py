"""Suites are played case by case, go on where they were stopped, and can be verified."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from robot_layouts.__main__ import main
from robot_layouts.core.processes.start import WorkerError
from robot_layouts.data import evaluate
from robot_layouts.data.receipts.receipt import Receipt, ReceiptError
from robot_layouts.data.suite.run import (
    begin_run,
    chosen_cases,
    chosen_policies,
    read_run,
    receipt_path,
    run_suite,
    verify_run,
)
from robot_layouts.data.suite.suite import Case, Suite, load_suite, save_suite
from robots import TaskError, UnknownNameError
from tasks import Randomization
from tests.data.kills import Kill, Killed
from tests.data.policies import TASK, Leans, fails, still

STILL, LEANS = "tests.data.policies:still", "tests.data.policies:LEANS"
FIRST = Case(TASK, (0, 1), name="First")
LATER = Case(
    TASK,
    (5,),
    name="Later",
    control_mode={"arm": "pd_joint_pos"},
    randomization=Randomization(gravity={"uniform": [9.0, 10.0]}),
)
SUITE = Suite("mine", (FIRST, LATER))
ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def played(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "still"
    run_suite(SUITE, folder, STILL, workers=0)
    return folder


def test_there_is_a_receipt_for_each_case(played):
    run = read_run(played)
    assert run.suite == SUITE
    assert run.missing == ()
    assert list(run.receipts) == ["First", "Later"]
    first = run.receipts["First"]
    scores = evaluate(still, TASK, [0, 1], workers=0).scores
    assert {e.seed: (e.success, e.total, e.steps) for e in first.episodes} == {
        seed: (score.success, score.total, score.steps) for seed, score in scores.items()
    }
    assert first.policy["name"] == STILL
    assert [e.seed for e in run.receipts["Later"].episodes] == [5]
    assert sorted(path.name for path in played.rglob("*")) == [
        "First.json", "Later.json", "receipts", "suite.yaml"
    ]  # fmt: skip


@pytest.mark.long
def test_workers_make_no_difference(played, tmp_path):
    run = run_suite(SUITE, tmp_path, STILL, workers=2)
    before = read_run(played).receipts
    assert {n: r.hash for n, r in run.receipts.items()} == {n: r.hash for n, r in before.items()}


@pytest.mark.long
def test_it_goes_on_where_it_was_killed(played, tmp_path, monkeypatch):
    events = []

    def play():
        return run_suite(
            SUITE, tmp_path, STILL, workers=0, on_event=lambda case, e: events.append((case, e))
        )

    with monkeypatch.context() as patch:
        Kill(1).watch(patch, [(Receipt, "write")])
        with pytest.raises(Killed):
            play()
    first = receipt_path(tmp_path, FIRST)
    before = first.stat().st_mtime_ns
    assert read_run(tmp_path).missing == ("Later",)
    events.clear()
    run = play()
    assert events[0] == (FIRST, None)
    assert {case.name for case, _ in events[1:]} == {"Later"}
    assert first.stat().st_mtime_ns == before
    assert run.receipts["Later"].hash == read_run(played).receipts["Later"].hash


def test_an_error_of_a_policy_keeps_what_is_finished(tmp_path):
    suite = Suite("two", (Case(TASK, (0,)), Case("PushCube-v1", (0,))))
    with pytest.raises(WorkerError, match="^PushCube-v1: seed 0: KeyError"):
        run_suite(suite, tmp_path, {TASK: STILL, "others": fails}, workers=0)
    assert read_run(tmp_path).missing == ("PushCube-v1",)


def test_two_runs_into_one_folder(tmp_path):
    """The second would leave receipts of another policy beside those of the first."""
    refused = []

    def meanwhile(case, event):
        with pytest.raises(TaskError, match=f"another run is playing into {tmp_path}"):
            run_suite(SUITE, tmp_path, LEANS, workers=0)
        refused.append(case.name)

    run = run_suite(SUITE, tmp_path, STILL, workers=0, on_event=meanwhile)
    assert refused == ["First", "First", "Later"]
    assert {receipt.policy["name"] for receipt in run.receipts.values()} == {STILL}
    assert run_suite(SUITE, tmp_path, STILL, workers=0).receipts == run.receipts


def test_some_cases_alone(tmp_path):
    run = run_suite(SUITE, tmp_path, STILL, only=["Later"], workers=0)
    assert list(run.receipts) == ["Later"]
    assert [case.name for case in chosen_cases(SUITE, [TASK])] == ["First", "Later"]
    with pytest.raises(UnknownNameError, match="unknown case of the suite mine 'Latr'. Did you m"):
        chosen_cases(SUITE, ["Latr"])


def test_who_plays():
    suite = Suite("two", (FIRST, Case("PickCube-v1", (0,))))

    def players(given, policies=None):
        suite_of_policies = replace(suite, policies=policies or {})
        return list(chosen_policies(suite_of_policies, suite.cases, given).values())

    assert players(None) == ["expert", "expert"]
    assert players(None, {"PushT-v1": STILL, "others": "expert"}) == [STILL, "expert"]
    assert players("expert", {"others": STILL}) == ["expert", "expert"]
    assert players({"push_t": STILL, "pick_cube": fails}) == [STILL, fails]
    with pytest.raises(TaskError, match="PickCube-v1 has no policy; name one, or one for 'o"):
        players({"PushT-v1": STILL})
    with pytest.raises(TaskError, match="the policy of PushT-v1 is given twice"):
        players({"PushT-v1": STILL, "push_t": STILL})
    with pytest.raises(UnknownNameError, match="unknown task 'PushX-v1'. Did you mean 'PushT-v1'"):
        players({"PushX-v1": STILL})
    with pytest.raises(TaskError, match="no policy 'tests.data.policies:stil'.*Did you mean"):
        players("tests.data.policies:stil")


@pytest.mark.parametrize("policy", [LEANS, Leans(), "expert"])
def test_another_policy_needs_another_folder(policy, played):
    files = {path: path.stat().st_mtime_ns for path in played.rglob("*")}
    with pytest.raises(TaskError, match="First.json is of the policy tests.data.policies:still"):
        run_suite(SUITE, played, policy, workers=0)
    assert {path: path.stat().st_mtime_ns for path in played.rglob("*")} == files


def test_another_suite_needs_another_folder(played, tmp_path):
    other = replace(SUITE, cases=SUITE.cases[:1])
    with pytest.raises(TaskError, match=f"of the suite mine {SUITE.id}; this is mine {other.id}"):
        run_suite(other, played, STILL, workers=0)
    (tmp_path / "thesis.tex").write_text("")
    with pytest.raises(TaskError, match="holds something else; the run of a suite needs its own"):
        begin_run(tmp_path, SUITE)
    with pytest.raises(TaskError, match="holds something else"):
        begin_run(tmp_path / "thesis.tex", SUITE)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_what_cannot_be_played_leaves_nothing(tmp_path):
    with pytest.raises(TaskError, match="no policy"):
        run_suite(SUITE, tmp_path / "run", "nowhere:policy", workers=0)
    with pytest.raises(UnknownNameError):
        run_suite(SUITE, tmp_path / "run", STILL, only=["x"], workers=0)
    assert not (tmp_path / "run").exists()


def test_all_is_played_again(played):
    seen = []
    found = verify_run(
        played, STILL, workers=0, on_event=lambda case, event: seen.append(case.name)
    )
    assert {name: one.equal for name, one in found.items()} == {"First": True, "Later": True}
    assert {*seen} == {"First", "Later"}


@pytest.mark.long
def test_a_policy_that_is_named_plays_again(played, tmp_path):
    assert verify_run(played, {"push_t": STILL}, workers=0)["Later"].equal
    found = verify_run(played, LEANS, workers=0)
    assert [one.equal for one in found.values()] == [False, False]
    run_suite(SUITE, tmp_path, Leans(), only=["Later"], workers=0)
    with pytest.raises(ReceiptError, match="^Later: the receipt's policy .*cannot be imported"):
        verify_run(tmp_path, workers=0)


def test_a_state_that_differs_is_named(played, tmp_path, capsys):
    run = read_run(played)
    begin_run(tmp_path, SUITE)
    first = run.receipts["First"]
    one, two = first.episodes
    changed = replace(two, states="0" * 64, trace=two.trace[:16] + "AAAA" + two.trace[20:])
    replace(first, episodes=(one, changed)).write(receipt_path(tmp_path, FIRST))
    assert main(["suite", "verify", str(tmp_path), "--workers=0", f"--policy={STILL}"]) == 1
    printed = capsys.readouterr().out
    assert f"First: {TASK}, {STILL}: 1 of 2 episodes equal to the last bit" in printed
    assert "seed 1" in printed
    assert "step 6" in printed  # 16 characters are 12 bytes, of 6 moments
    assert "0 of 1 receipts verified; 1 case was not played" in printed


def test_verifying_finds_receipts_that_were_changed(played, tmp_path):
    begin_run(tmp_path, SUITE)
    path = receipt_path(tmp_path, LATER)
    read_run(played).receipts["Later"].write(path)
    path.write_text(path.read_text().replace('"success": false', '"success": true'))
    assert not verify_run(tmp_path, STILL, workers=0)["Later"].equal
    with pytest.raises(ReceiptError, match="was changed after it was written"):
        run_suite(SUITE, tmp_path, STILL, workers=0)


def test_the_command(played, tmp_path, capsys):
    file, out = tmp_path / "mine.yaml", tmp_path / "run"
    save_suite(SUITE, file)
    assert main(["suite", "show", str(file)]) == 0
    assert capsys.readouterr().out == f"{SUITE}\nSHA-256: {SUITE.hash}\n"
    words = ["suite", "run", str(file), f"--out={out}", "--workers=0", "--policy"]
    assert main([*words, f"{TASK}={STILL}"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"mine {SUITE.id} in {out}",
        "  First  0.0 (0.0 to 65.8) % of 2",
        "  Later  0.0 (0.0 to 79.3) % of 1",
        "  all    0.0 (0.0 to 56.1) % of 3",
    ]
    assert main([*words, STILL]) == 0
    assert capsys.readouterr().err.splitlines()[:2] == [
        "First was played before",
        "Later was played before",
    ]
    assert main(["suite", "verify", str(out), "--workers=0", "--policy", STILL]) == 0
    assert capsys.readouterr().out.endswith("2 of 2 receipts verified; 0 cases were not played\n")
    assert main([*words, STILL, STILL]) == 1
    assert "the policy of others is given twice" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_process_that_is_stopped(how, tmp_path):
    long = Suite("long", (FIRST, replace(LATER, seeds=range(100_000))))
    file, out = tmp_path / "long.yaml", tmp_path / "run"
    save_suite(long, file)
    words = ["suite", "run", str(file), f"--out={out}", "--workers=1", "--policy", STILL]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        [sys.executable, "-m", "robot_layouts", *words], stderr=subprocess.PIPE, env=environment
    )
    deadline = time.monotonic() + 120
    while not receipt_path(out, FIRST).exists():
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(how)
    _, printed = process.communicate(timeout=60)
    assert process.returncode == (-how if how is signal.SIGKILL else 130)
    assert how is signal.SIGKILL or b"the same command goes on from there" in printed
    assert list(read_run(out).receipts) == ["First"]
    run = run_suite(load_suite(out / "suite.yaml"), out, STILL, only=["First"], workers=0)
    assert list(run.receipts) == ["First"]
