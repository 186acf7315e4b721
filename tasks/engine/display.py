"""A task and a scenario in a few lines, and as notebooks show them."""

from __future__ import annotations

import inspect
from dataclasses import MISSING, fields, is_dataclass
from typing import Any

from layouts.preview import layout_html
from robot_layouts.core.pages import heading, table
from robots import RobotDescriptor

Task = Any  # a `TaskEnv`, whose module needs this one
Scenario = Any  # likewise


def task_text(task: Task) -> str:
    """Return a task in a few lines: its id, and what was made of it."""
    rows = task_rows(task)
    width = max(map(len, rows))
    lines = [f"  {what:{width}}  {value}" for what, value in rows.items()]
    return "\n".join([f"{_title(task)}: {_size(task)}", *lines])


def task_html(task: Task) -> str:
    """Return the same with the first paragraph of its docstring and the layout's picture."""
    about = inspect.cleandoc(task.task_class.__doc__ or "").partition("\n\n")[0]
    return (
        f"{heading(_title(task), ' '.join(about.split()) or _size(task))}"
        f"{table((), {'made': _size(task), **task_rows(task)}.items())}"
        f"{layout_html(task.scenario.layout)}"
    )


def task_rows(task: Task) -> dict[str, str]:
    """Return what was made of a task, in words."""
    split = ", ".join(f"{name} {s.start}:{s.stop}" for name, s in task.action_split.items())
    robots = ", ".join(f"{name}={p.robot.name}" for name, p in task.layout.items())
    size = max((part.stop for part in task.observation_slices.values()), default=0)
    observed = f"{size} numbers ({task.obs_mode})" if size else task.obs_mode
    return {
        "robots": robots,
        "action": f"{task.layout.action_dim} numbers: {split}",
        "control": str(task.control_mode),
        "observation": observed,
        "reward": task.reward_mode,
        **(
            {"varies": ", ".join(varied.declared)}
            if (varied := task.scenario.randomization)
            else {}
        ),
    }


def scenario_text(scenario: Scenario) -> str:
    """Return the fields of a scenario that differ from their defaults."""
    return _brief(scenario)


def scenario_html(scenario: Scenario) -> str:
    """Return the same as a table, with the layout's picture."""
    changed = _changed(scenario)
    title = heading("Scenario", "the fields that differ from their defaults")
    return f"{title}{table((), changed.items())}{layout_html(scenario.layout)}"


def _brief(value: Any) -> str:
    """Return a dataclass with the fields alone that differ from their defaults."""
    if not is_dataclass(value) or isinstance(value, (type, RobotDescriptor)):
        return repr(value)
    changed = ", ".join(f"{name}={text}" for name, text in _changed(value).items())
    return f"{type(value).__name__}({changed})"


def _changed(value: Any) -> dict[str, str]:
    changed: dict[str, str] = {}
    for known in fields(value):
        given, made = getattr(value, known.name), known.default_factory
        usual = known.default if made is MISSING else made()
        if usual is MISSING or given != usual:
            changed[known.name] = _brief(given)
    return changed


def _title(task: Task) -> str:
    return task.task_id or task.task_class.__name__


def _size(task: Task) -> str:
    count = task.num_envs
    return (
        f"{count} environment{'s' * (count > 1)}, {task.max_episode_steps} steps an episode,"
        f" {task.scenario.control_frequency:g} per s"
    )
