"""Suites for tests: small ones, and receipts of runs that nobody has to play."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path

from robot_layouts.data.receipts.provenance import describe_making
from robot_layouts.data.receipts.receipt import EpisodeReceipt, Receipt
from robot_layouts.data.suite.run import SuiteRun, begin_run, read_run, receipt_path
from robot_layouts.data.suite.suite import Case, Suite
from tasks import get_task_class
from tasks.registry import make_scenario


def written(folder: Path, text: str) -> Path:
    """Write a suite's file, and return its path."""
    path = folder / "suite_of_mine.yaml"
    path.write_text(text)
    return path


def receipt(case: Case, successes: Mapping[int, bool]) -> Receipt:
    """Return a receipt of episodes, each of as many steps as its seed and one."""
    cls = get_task_class(case.task)
    return Receipt(
        {"id": cls.task_id, "class": "lab:Task", "sha256": None},
        {"kind": "policy", "name": "lab:POLICY", "sha256": "ab" * 32},
        describe_making(cls, make_scenario(cls, **case.making)),
        {"versions": {"python": "3.11.0", "sapien": "3.0.3"}, "processor": {"name": "A & B"}},
        tuple(_episode(seed, success) for seed, success in successes.items()),
    )


def made_run(folder: Path, suite: Suite, solved: Mapping[str, Sequence[int]]) -> SuiteRun:
    """Return a run with receipts of some cases, by name, each with the seeds that it solved."""
    begin_run(folder, suite)
    for case in suite.cases:
        if case.name in solved:
            successes = {seed: seed in solved[case.name] for seed in case.seeds}
            receipt(case, successes).write(receipt_path(folder, case))
    return read_run(folder)


def _episode(seed: int, success: bool) -> EpisodeReceipt:
    steps = seed + 1
    return EpisodeReceipt(
        seed,
        success,
        steps,
        steps / 2,
        sha256(bytes([seed % 256])).hexdigest(),
        b64encode(bytes(2 * (steps + 1))).decode(),
        "" if success else "it was <dropped>",
    )
