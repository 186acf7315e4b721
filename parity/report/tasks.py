"""What a report says about one task."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from parity.compare.task_summary import number_text
from parity.report.figures import cells, is_verified
from tasks import MultiRobotTask, get_task_class
from tasks.description import read_docstring, robots_text


def task_content(
    task_id: str, entry: Mapping[str, Any] | None, result: Mapping[str, Any] | None, runs: Path
) -> dict[str, Any]:
    """Return what the page says about a task.

    Args:
        task_id: The task.
        entry: Its entry in the sweep's summary, or None.
        result: Its recorded comparison, or None.
        runs: Folder of the sweep.
    """
    cls = get_task_class(task_id)
    robots, text = robots_text(cls.layout), read_docstring(cls)
    success = f" Success: {text.success}" if text.success else ""
    return {
        "id": task_id,
        "robots": robots,
        "summary": f"{text.summary}{success}",
        "numbers": f"{cls.layout.action_dim} action numbers, {cls.max_episode_steps} steps",
        "cells": cells(entry, result),
        "status": _status(entry),
        "no_clip": _sentence(no_clip(entry)),
        "problems": list(problems(entry)),
        "commands": list(_commands(task_id, entry, runs)),
        "caption": _caption(entry["clip"], cls) if entry and entry["clip"] else "",
    }


def _status(entry: Mapping[str, Any] | None) -> dict[str, str]:
    if entry is None:
        return {"kind": "open", "text": "not swept"}
    if entry["error"]:
        return {"kind": "bad", "text": "failed"}
    if not entry["equal"]:
        return {"kind": "bad", "text": "differs"}
    if is_verified(entry):
        return {"kind": "good", "text": "equal, both succeed"}
    return {"kind": "open", "text": "equal, no verified clip"}


def no_clip(entry: Mapping[str, Any] | None) -> str:
    """Say why a task has no clip."""
    if entry is None:
        return "not swept"
    return entry["no_clip"] or entry["error"] or "the sweep did not come that far"


def _sentence(words: str) -> str:
    return f"{words[0].upper()}{words[1:].rstrip('.')}."


def problems(entry: Mapping[str, Any] | None) -> Iterator[str]:
    """Yield what failed or differs in a task, a sentence each."""
    if entry is None:
        return
    if entry["error"]:
        yield f"The sweep of this task failed: {entry['error']}"
    for difference in (entry["agreement"] or {}).get("differing", ()):
        yield f"Seed {difference['seed']} differs {difference['where']}."
    rollout = entry["rollout"]
    if rollout and rollout["max_difference"] != 0:
        yield f"Arrays of the rollout differ by up to {number_text(rollout['max_difference'])}."


def _caption(clip: Mapping[str, Any], cls: type[MultiRobotTask]) -> str:
    sides = [
        f"{name} {'succeeds' if clip[key] else 'does not succeed'}"
        for name, key in (("native", "native_success"), ("the clone", "our_success"))
    ]
    differing, frames = clip["differing_frames"], clip["frames"]
    pixels = (
        f"all {frames} frames equal in every pixel"
        if differing == 0
        else f"{differing} of {frames} frames differ, mean pixel difference"
        f" {clip['mean_pixel_difference']:.2g} of 255"
    )
    state, steps = number_text(clip["max_state_difference"]), clip["steps"]
    own = cls.max_episode_steps
    beyond = f" (the task allows {own})" if steps > own else ""
    return (
        f"Seed {clip['seed']}, {steps} steps{beyond} of {clip['source']}: {' and '.join(sides)};"
        f" {pixels}; max |Δ| of the state {state}."
    )


def _commands(task_id: str, entry: Mapping[str, Any] | None, runs: Path) -> Iterator[str]:
    yield f"robot-layouts parity compare --task {task_id} --seeds 10 --steps 100"
    rollout = entry["rollout"] if entry else None
    if rollout is None or rollout["source"] == "random":
        yield f"robot-layouts parity sweep --tasks {task_id} --out {shlex.quote(str(runs))}"
        return
    demo = "" if rollout["source"] == "expert" else f" --demo {shlex.quote(rollout['source'])}"
    if demo:
        yield f"robot-layouts parity replay --task {task_id}{demo}"
    options = f"--task {task_id}{demo} --seed {rollout['seed']} --out {shlex.quote(str(runs))}"
    yield f"robot-layouts parity rollout {options}"
    yield f"robot-layouts parity render {options}"
