"""Receipts to verify, and to change by hand."""

import json
from pathlib import Path

from robot_layouts.data import evaluate
from robot_layouts.data.receipts import Verification, verify
from tests.data.policies import LEANS, TASK

NAMED = "tests.data.policies:LEANS"


def written(
    tmp_path, name="receipt.json", policy=LEANS, seeds=range(3), task=TASK, **details
) -> Path:
    details = {"workers": 0, "max_episode_steps": 10, **details}
    evaluate(policy, task, seeds, receipt=tmp_path / name, **details)
    return tmp_path / name


def again(receipt, **details) -> Verification:
    return verify(receipt, workers=0, **details)


def edit(path: Path, change) -> Path:
    """Change a receipt by hand."""
    about = json.loads(path.read_text())
    change(about)
    path.write_text(json.dumps(about))
    return path
