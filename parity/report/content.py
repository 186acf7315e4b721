"""What a report says: everything that its template is given, but the clips."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from parity.report.figures import COLUMNS, RECORDED_COLUMNS, tiles
from parity.report.gaps import missing, not_cloned
from parity.report.tasks import task_content
from tasks import list_clones


def page_content(
    runs: Path, swept: Mapping[str, Any], recorded: Mapping[str, Any]
) -> dict[str, Any]:
    """Return what the page says.

    Args:
        runs: Folder of the sweep.
        swept: Its summary.
        recorded: The recorded comparison.
    """
    entries: Mapping[str, Any] = swept["tasks"]
    task_ids = sorted({*list_clones(), *entries})
    found = {task_id: entries.get(task_id) for task_id in task_ids}
    others, note = not_cloned()
    return {
        "tiles": list(tiles(found, recorded["tasks"])),
        "columns": COLUMNS,
        "recorded_columns": RECORDED_COLUMNS,
        "tasks": [
            task_content(task_id, entry, recorded["tasks"].get(task_id), runs)
            for task_id, entry in found.items()
        ],
        "missing": list(missing(found)),
        "not_cloned": others,
        "not_cloned_note": note,
        "recorded_with": _with(recorded),
        "swept_with": _with(swept) if "versions" in swept else "versions that were not noted",
        "date": datetime.now(timezone.utc).strftime("%-d %B %Y"),
        "commands": [
            "robot-layouts parity compare --all --demos DIR --record",
            f"robot-layouts parity sweep --demos DIR --out {shlex.quote(str(runs))}",
            f"robot-layouts parity report --runs {shlex.quote(str(runs))}",
        ],
    }


def _with(found: Mapping[str, Any]) -> str:
    packages = ", ".join(f"{name} {version}" for name, version in found["versions"].items())
    return f"{packages} on {found['machine']}"
