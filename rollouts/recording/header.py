"""What all episodes of a recording have in common, as json and attributes of its files say it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

from robots import CONTROL_MODES
from robots.control_modes import plain_mode
from rollouts.reading.guessed_robots import describe_guessed
from rollouts.reading.manifest import FILE_NUMBER
from rollouts.reading.provenance import describe_layout, describe_simulation, differences
from tasks import MultiRobotTask
from tasks.native.format import observation_keys
from tasks.registry import full_name

# What may change from one resumption to the next, and what earlier versions did not write.
NOT_COMPARED = ("source_type", "source_desc", "guessed", FILE_NUMBER)


def describe_task(task: MultiRobotTask, source: str, source_desc: str | None) -> dict[str, Any]:
    """Return what every file of a recording says about all its episodes.

    Args:
        task: The task.
        source: Where the actions come from, in ManiSkill's words.
        source_desc: The same in one's own words.

    Raises:
        AssetError: If robot files cannot be found.
    """
    name, guessed = full_name(type(task)), describe_guessed(task.scenario.layout)
    return {
        "env_info": {
            "env_id": task.task_id,
            **({"module": name.rpartition(":")[0]} if ":" in name else {}),
            "env_kwargs": {
                "obs_mode": "none",
                "reward_mode": task.reward_mode,
                "control_mode": plain_mode(task.control_mode),
                "sim_backend": "physx_cpu",
            },
            "max_episode_steps": task.max_episode_steps,
        },
        "source_type": source,
        "source_desc": source_desc,
        "layout": describe_layout(task.layout),
        "simulation": describe_simulation(task),
        **({"guessed": guessed} if guessed else {}),
    }


def numbered(header: Mapping[str, Any], number: int) -> dict[str, Any]:
    """Return the header of one of a recording's files; the first is not numbered."""
    return {**header, **({FILE_NUMBER: number} if number else {})}


def header_differences(recorded: Mapping[str, Any], here: Mapping[str, Any]) -> list[str]:
    """Return one phrase per field in which two headers differ, as far as it matters."""
    return differences(_compared(recorded), _compared(here))


def header_hash(header: Mapping[str, Any]) -> str:
    """Return the SHA-256 of what must not differ."""
    text = json.dumps(_compared(header), sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _compared(header: Mapping[str, Any]) -> dict[str, Any]:
    about = {name: value for name, value in header.items() if name not in NOT_COMPARED}
    if isinstance(info := about.get("env_info"), dict):
        about["env_info"] = {name: value for name, value in info.items() if name != "module"}
    return about


def recorded_control_mode(task: MultiRobotTask) -> str | dict[str, str]:
    """Return the control mode as native writes it: by robot where there are several.

    Where the arms of a robot have modes of their own, it is the mode by arm.
    """
    mode, keys = task.control_mode, observation_keys(task.layout)
    if isinstance(mode, str):
        return mode if None in keys.values() else {str(key): mode for key in keys.values()}
    modes = {task.layout.arm_name(arm): own for arm, own in mode.items()}
    by_arm = {
        arm: modes.get(arm, modes.get(task.layout.owner(arm), CONTROL_MODES[0]))
        for arm in task.layout.arms
    }
    if None in keys.values() or set(by_arm) != set(task.layout):
        return by_arm
    return {str(keys[robot]): own for robot, own in by_arm.items()}
