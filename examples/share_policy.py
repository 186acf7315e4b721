"""Writes what `imitate.py` has learned as a policy that anyone can play from the Hugging Face Hub.

    python examples/share_policy.py runs/imitate/TwoRobotPickCube-v1/policy.pt shared
    hf upload OWNER/NAME shared .

The file that `imitate.py` writes is a pickle, which others should not have to open. Here the
weights become plain numbers, and a declaration says what computes with them: ``--policy
hub:OWNER/NAME`` plays them, and nothing that it downloads is executed.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from imitate import MODE, OBSERVED, ClonedPolicy

import tasks
from robot_layouts.data.playing.shared_policy import (
    FORMAT,
    Declaration,
    Observed,
    SharedPolicy,
    save_policy,
)
from robots import RobotLayoutsError
from tasks import Cube

CARD = """---
library_name: robot-layouts
pipeline_tag: robotics
---

A policy of {task}, learned from {episodes:,} of its expert's episodes by behaviour cloning. With
robot-layouts:

    robot-layouts evaluate --task {task} --policy hub:OWNER/NAME \\
        --obs-mode {observed} --control-mode {mode}
"""


def share(file: Path, folder: Path) -> SharedPolicy:
    """Write a policy, and a card, to a folder.

    Args:
        file: What ``imitate.py`` wrote, which you trust.
        folder: The folder.

    Raises:
        RobotLayoutsError: If it cannot be written.
    """
    recipe = ClonedPolicy.load(file).recipe
    saved: dict[str, Any] = torch.load(file, weights_only=True)
    _, outputs, width, blocks = saved["sizes"]
    weights = dict[str, Any](saved["network"])
    switches = weights.pop("switches").nonzero().flatten().tolist()
    declared: Declaration = {
        "format": FORMAT,
        "task": recipe.task,
        "control_mode": MODE,
        "observed": [*_observed(recipe.task)],
        "action_dim": outputs // recipe.chunk,
        "chunk": recipe.chunk,
        "played": recipe.played,
        "width": width,
        "blocks": blocks,
        "switches": switches,
    }
    policy = save_policy(folder, declared, {key: value.numpy() for key, value in weights.items()})
    about = {"task": recipe.task, "episodes": recipe.episodes, "observed": OBSERVED, "mode": MODE}
    (folder / "README.md").write_text(CARD.format(**about))
    return policy


def _observed(task: str) -> Iterator[Observed]:
    """Yield what the network is given of an observation, as `imitate.Senses` does."""
    env = tasks.make(task, obs_mode=OBSERVED)
    observation, _ = env.reset(seed=0)
    env.close()
    bodies = tasks.get_task_class(task).bodies.items()
    cubes = {f"{name}_pose" for name, body in bodies if isinstance(body, Cube)}
    yield from _parts(observation, cubes)


def _parts(observation: Mapping[str, Any], cubes: set[str], within: str = "") -> Iterator[Observed]:
    for name, part in observation.items():
        if isinstance(part, Mapping):
            yield from _parts(part, cubes, f"{within}{name}/")
        elif name in cubes:
            yield {"key": within + name, "symmetry": "cube"}
        elif name != "qvel":
            yield {"key": within + name}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the example; returns 0 if the policy was written."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("file", type=Path, help="what imitate.py wrote: policy.pt")
    parser.add_argument("folder", type=Path, help="where to write the policy")
    options = parser.parse_args(arguments)
    try:
        share(options.file, options.folder)
    except RobotLayoutsError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"see {options.folder}; share it by: hf upload OWNER/NAME {options.folder} .")
    return 0


if __name__ == "__main__":
    sys.exit(main())
