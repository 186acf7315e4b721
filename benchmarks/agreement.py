"""``python -m benchmarks agreement``: worlds on a device beside MuJoCo's own, step by step."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import torch
from tqdm import tqdm

from benchmarks.records import DOCS, read_record, table, versions_of, write_page, write_record
from robot_layouts.experts import find_expert, list_experts
from robots import RobotLayoutsError
from tasks import get_task_class, make
from tasks.interfaces.device import DeviceTask

WORLDS = 8
# At 1, drives of Pandas are at their limit of force to the last bit, on either side of it.
SHARE = np.float32(0.99)
NEAR = 1e-4  # rad


def agreement(
    *, tasks: tuple[str, ...] | None = None, steps: int = 50, out: Path = DOCS / "device.json"
) -> int:
    """Play an expert's actions in eight worlds on the processor, and in MuJoCo.

    Args:
        tasks: Which tasks are played anew; all that are not in the record yet if not given.
        steps: How many control steps of an expert's plan.
        out: The record, written after every task; the page is beside it.

    Raises:
        RobotLayoutsError: If something cannot be read or written.
    """
    torch.set_num_threads(1)
    record = read_record(out, versions={}, tasks={})
    known = [
        task for task in list_experts() if get_task_class(task).__module__.startswith("tasks.")
    ]
    chosen = [task for task in known if task not in record["tasks"]] if tasks is None else tasks
    for task in tqdm(chosen, disable=None):
        record["tasks"][task] = _played(task, steps)
        record["versions"] = versions_of("mujoco", "mujoco-warp", "warp-lang", "torch")
        write_record(out, record)
    seen = sorted(record["tasks"].items())
    write_page(
        out,
        "device",
        versions=record["versions"],
        table=table(
            ("task", "steps", "largest difference", "more than 1e-4 rad since step"),
            [_row(task, found) for task, found in seen if "refused" not in found],
        ),
        refused=[(task, found["refused"]) for task, found in seen if "refused" in found],
        otherwise=[task for task, found in seen if not found.get("success", True)],
        unlike=[task for task, found in seen if not found.get("alike", True)],
        crowded=[task for task, found in seen if found.get("overflowed")],
        untried=", ".join(task for task in known if task not in record["tasks"]),
        worlds=WORLDS,
    )
    return 0


def _played(task: str, steps: int) -> dict[str, Any]:
    """Return how far joints of worlds on a device are from those in MuJoCo."""
    try:
        env = DeviceTask(task, WORLDS, "cpu", "DISABLED", starts=1)
    except RobotLayoutsError as error:
        return {"refused": str(error)}
    with closing(env), closing(make(task, simulator="mujoco")) as host:
        (seed,) = env.seeds
        plan = SHARE * np.asarray([*find_expert(task)(host, seed)], np.float32)
        env.reset(seed=[seed] * WORLDS)
        host.reset(seed)
        away, alike, success, info = list[float](), True, True, dict[str, Any]()
        for action in plan[:steps]:
            *_, info = env.step(np.repeat(action[None], WORLDS, 0))
            *_, told = host.step(action[None])
            found = env.state.joint_positions
            away.append(float((found - torch.from_numpy(host.state.joint_positions)).abs().max()))
            alike &= torch.equal(found, found[:1].expand_as(found))
            success &= torch.equal(info["success"], told["success"].expand(WORLDS))
        return {
            "steps": len(away),
            "largest": max(away),
            "since": next((step for step, far in enumerate(away, 1) if far > NEAR), None),
            "alike": alike,
            "success": success,
            "overflowed": bool(info["overflowed"].any()),
        }


def _row(task: str, found: dict[str, Any]) -> tuple[str, ...]:
    since = found["since"]
    return task, str(found["steps"]), f"{found['largest']:.1e} rad", str(since or "")
