"""What an evaluation depends on: task and policy with their code and files, and the machine.

What a task was made with is plain data, from which it is made again.
"""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any

import torch
from typing_extensions import NotRequired, TypedDict

from layouts import Layout
from layouts.placement import RobotLike
from objects.shapes import Friction
from robot_layouts.core.own_packages import PACKAGES
from robot_layouts.core.schema import FieldError, Finite, Name, Object, check, length, whole
from robot_layouts.data.actors import EXPERT, POLICY, definition, name_of
from robot_layouts.data.playing.evaluation_job import EvaluationJob, TracedScore
from robot_layouts.data.playing.served.policy import ServedPolicy
from robot_layouts.data.playing.shared_policy import SharedPolicy
from robot_layouts.data.playing.together import is_batched
from robot_layouts.data.reading.json_files import sized_file
from robot_layouts.data.reading.provenance import (
    GUESSED,
    LAYOUT,
    describe_guessed,
    describe_layout,
    descriptor_digest,
)
from robot_layouts.data.reading.recorded_task import layout_again, same_places
from robot_layouts.data.receipts.receipt import EpisodeReceipt, Receipt, ReceiptError
from robot_layouts.experts.registry import Expert
from robot_layouts.simulation import Camera, PhysicsSettings
from robots import RobotLayoutsError, UnreadableFileError
from robots.control_modes import plain_mode
from robots.urdf.summary import asset_checksums
from tasks import MultiRobotTask, Scenario
from tasks.engine.cameras import plain
from tasks.episode import Score
from tasks.randomization.declaration import Randomization

_MOST = 10**6
_MAIN = "__main__"  # a script or a notebook, which cannot be imported
_VARIABLE = re.compile(r"""\b(?:environ(?:\.get\(|\[)|getenv\()\s*["'](\w+)["']""")


class _ProvenanceMaking(TypedDict):
    layout: LAYOUT
    obs_mode: Name
    reward_mode: Name
    control_mode: Name | dict[str, Name] | None
    control_frequency: Finite
    max_episode_steps: Annotated[int, whole(1, 2**31 - 1)]
    physics: Object | None
    randomization: Object | None
    cameras: list[Object]
    camera_size: Annotated[list[Annotated[int, whole(1, _MOST)]], length(2)] | None
    bystanders: Name | None
    simulator: Name
    visuals: NotRequired[Name]
    num_envs: NotRequired[Annotated[int, whole(1, _MOST)]]
    sensor_configs: NotRequired[Object]
    enable_shadow: NotRequired[bool]
    touch: NotRequired[bool | Object]


def describe_making(
    cls: type[MultiRobotTask],
    scenario: Scenario,
    num_envs: int | None = None,
    *,
    pictures: bool = False,
) -> dict[str, Any]:
    """Return what a task is made with.

    Of each robot in ``layout`` it is what `describe_layout` says, and its ``control_mode`` there,
    a SHA-256 of its ``descriptor`` and of each of its ``files`` that physics reads.

    Args:
        cls: Class of the task.
        scenario: What it is made with.
        num_envs: How many environments play at once, where that makes a difference.
        pictures: Whether ``files`` are also those that are drawn.

    Raises:
        AssetError: If robot files cannot be found.
    """
    mode, varied = scenario.control_mode, scenario.randomization
    described = {
        "layout": _describe_places(scenario.layout, pictures=pictures),
        "obs_mode": scenario.obs_mode,
        "reward_mode": scenario.reward_mode or cls.reward_modes[0],
        "control_mode": None if mode is None else plain_mode(mode),
        "control_frequency": scenario.control_frequency,
        "max_episode_steps": scenario.max_episode_steps or cls.max_episode_steps,
        "physics": None if scenario.physics is None else asdict(scenario.physics),
        "randomization": varied.to_json() if varied else None,
        "cameras": [asdict(camera) for camera in scenario.cameras],
        "camera_size": scenario.camera_size,
        "bystanders": scenario.bystanders,
        "simulator": scenario.simulator,
        **({} if scenario.visuals == "full" else {"visuals": scenario.visuals}),
        **({} if num_envs is None else {"num_envs": num_envs}),
        **_filled(
            sensor_configs=plain(scenario.sensor_configs),
            enable_shadow=scenario.enable_shadow,
            touch=plain(scenario.touch),
        ),
    }
    return json.loads(json.dumps(described))


def _describe_places(layout: Layout, *, pictures: bool) -> dict[str, Any]:
    return {
        place: {
            **{name: value for name, value in about.items() if name != "assets"},
            "control_mode": layout[place].control_mode,
            "descriptor": descriptor_digest(layout[place].robot),
            "files": asset_checksums(layout[place].robot.urdf, pictures=pictures),
        }
        for place, about in describe_layout(layout).items()
    }


def make_again(
    making: Mapping[str, Any],
    guessed: Mapping[str, Any],
    cls: type[MultiRobotTask],
    robots: Mapping[str, RobotLike],
) -> dict[str, Any]:
    """Return the arguments of `tasks.registry.make_scenario` for what a receipt says.

    Args:
        making: What `describe_making` returned.
        guessed: What `robot_layouts.data.reading.provenance.describe_guessed` returned then.
        cls: Class of the task.
        robots: Which robots to take, by place, where that does not say it.

    Raises:
        ReceiptError: If it is invalid, or a robot is not available here.
    """
    try:
        arguments = check(dict(making), _ProvenanceMaking, "making")
        arguments.pop("num_envs", None)
        check(dict(guessed), GUESSED, "guessed")
        layout = layout_again(making["layout"], guessed, cls.layout, robots, "the receipt")
        physics, varied = making["physics"], making["randomization"]
        size = making["camera_size"]
        return {
            **arguments,
            "layout": cls.layout if same_layout(layout, cls.layout) else layout,
            "physics": None if physics is None else _physics(physics),
            "randomization": None if varied is None else Randomization.from_json(varied),
            "cameras": [Camera(**camera) for camera in making["cameras"]],
            "camera_size": None if size is None else tuple(size),
            "check_layout": False,  # it was played like that
        }
    except (FieldError, RobotLayoutsError, TypeError, KeyError) as error:
        raise ReceiptError(f"the receipt's task cannot be made here: {error}") from error


def same_layout(first: Layout, second: Layout) -> bool:
    """Return whether two layouts have the same robots, places and control modes."""
    modes = ([placement.control_mode for placement in each.values()] for each in (first, second))
    return same_places(first, second) and next(modes) == next(modes)


def _physics(described: Mapping[str, Any]) -> PhysicsSettings:
    settings: dict[str, Any] = {**described, "friction": Friction(**described["friction"])}
    return PhysicsSettings(**settings)


def describe_job(job: EvaluationJob, name: str | None = None) -> dict[str, Any]:
    """Return the parts of a receipt that describe what is played: ``task``, ``policy``, ``making``.

    Args:
        job: What is played.
        name: Where its policy was imported from, ``module:name``; None: it is looked for.

    Raises:
        AssetError: If robot files cannot be found.
        ReceiptError: If a file of the policy cannot be read.
    """
    cast, pictures = job.cast, job.pictures is not None
    at_once = job.scenario.num_envs if is_batched(cast.policy) else None
    expert = cast.expert
    return {
        "task": describe_task(job.task),
        "policy": describe_policy(cast.policy, name) if expert is None else describe_expert(expert),
        "making": describe_making(job.task, job.scenario, at_once, pictures=pictures),
    }


def receipt_of(
    described: Mapping[str, Any], job: EvaluationJob, scores: Mapping[int, Score]
) -> Receipt:
    """Return the receipt of episodes that were played.

    Its environment is that of the first episode; in ``others`` are those that differ from it.

    Args:
        described: What `describe_job` returned before they were.
        job: What was played.
        scores: Seed → how it went, each a `TracedScore`.
    """
    traced = {seed: score for seed, score in scores.items() if isinstance(score, TracedScore)}
    different: list[Mapping[str, Any]] = []
    for score in traced.values():
        if score.environment not in different:
            different.append(score.environment)
    first, *others = different
    more = {
        "others": others,
        "guessed": describe_guessed(job.scenario.layout),
        "variables": variables_read(job.cast.policy, described["policy"]["name"]),
    }
    return Receipt(
        **described,
        environment={**first, **{name: value for name, value in more.items() if value}},
        episodes=tuple(episode_of(seed, score) for seed, score in traced.items()),
        pictures={} if job.pictures is None else {"interval": job.pictures.interval},
    )


def episode_of(seed: int, score: TracedScore) -> EpisodeReceipt:
    """Return what a receipt says of an episode that was played."""
    return EpisodeReceipt(
        seed,
        score.success,
        score.steps,
        score.total,
        score.trace.states,
        score.trace.trace,
        score.reason,
        {name: asdict(trace) for name, trace in score.pictures.items()},
        score.stage_score,
    )


def describe_task(cls: type[MultiRobotTask]) -> dict[str, Any]:
    """Return which task this is.

    It has ``id``, ``class`` (``module:Class``), ``sha256`` of that module's file, and in ``also``,
    by name, those of modules outside this library that define classes that it inherits from.
    """
    bases = {base.__module__ for base in cls.__mro__[1:-1]} - {cls.__module__}
    outside = sorted(name for name in bases if name.partition(".")[0] not in PACKAGES)
    return {
        "id": cls.task_id,
        "class": f"{cls.__module__}:{cls.__qualname__}",
        "sha256": _module_checksum(cls.__module__),
        **_filled(also={name: _module_checksum(name) for name in outside}),
    }


def describe_expert(expert: Expert) -> dict[str, Any]:
    """Return which expert this is; see `describe_policy`."""
    module = definition(expert).__module__
    return {"kind": EXPERT, "name": name_of(expert), "sha256": _module_checksum(module)}


def describe_policy(policy: Any, name: str | None = None) -> dict[str, Any]:
    """Return who this policy is.

    It has ``kind``, ``name`` (``module:name``), whether that is ``importable``, and ``sha256`` of
    the file of that module. In ``also`` is that of the module that defines its class, if that is
    another one; in ``files`` those of the files that it names by its attribute ``file`` or
    ``files``; in ``weights`` one over the tensors of each ``torch.nn.Module`` that it is or has.
    Of a policy that is ``served``, only the address and the file of keys are known; one from the
    Hub has files alone, and a name with the commit that they are of.

    Args:
        policy: What gives actions.
        name: Where it was imported from, ``module:name``; None: it is looked for.

    Raises:
        ReceiptError: If one of its files cannot be read.
    """
    if isinstance(policy, ServedPolicy):
        about = {"kind": POLICY, "name": policy.name, "sha256": None, "served": True}
        return {**about, **_filled(files=_files(policy))}
    if isinstance(policy, SharedPolicy):
        about = {"kind": POLICY, "name": policy.name, "importable": True, "sha256": None}
        return {**about, "files": _files(policy)}
    found = name or _importable_name(policy)
    module, defining = (found or name_of(policy)).partition(":")[0], definition(policy).__module__
    return {
        "kind": POLICY,
        "name": found or name_of(policy),
        "importable": found is not None,
        "sha256": _module_checksum(module),
        **_filled(
            also={} if defining == module else {defining: _module_checksum(defining)},
            files=_files(policy),
            weights=_weights(policy),
        ),
    }


def variables_read(policy: Any, name: str) -> str:
    """Return the environment variables that are set and that the source of a policy reads by name.

    Their values are left out: they may be secret.

    Args:
        policy: What gives actions.
        name: Where it was imported from, ``module:name``.
    """
    found = set[str]()
    for module in {name.partition(":")[0], definition(policy).__module__}:
        if file := getattr(sys.modules.get(module), "__file__", None):
            with suppress(OSError):
                found.update(_VARIABLE.findall(Path(file).read_text(errors="replace")))
    return " ".join(sorted(found & {*os.environ}))


def _importable_name(policy: Any) -> str | None:
    """Return ``module:name`` by which another process finds this very thing, if there is one."""
    module = definition(policy).__module__
    if module == _MAIN or module not in sys.modules:
        return None
    names = vars(sys.modules[module])
    found = next((name for name, value in names.items() if value is policy), None)
    return None if found is None else f"{module}:{found}"


def _filled(**parts: Any) -> dict[str, Any]:
    """Return those parts that hold something."""
    return {name: part for name, part in parts.items() if part}


def _module_checksum(name: str) -> str | None:
    """Return the SHA-256 of a module that is imported; None of one without a file of its own."""
    file = getattr(sys.modules.get(name), "__file__", None)
    try:
        return None if file is None else sized_file(file)["sha256"]
    except UnreadableFileError:  # inside an archive
        return None


def _files(policy: Any) -> dict[str, str]:
    """Return the SHA-256 of each file that a policy names, by its path below their folder."""
    one, several = getattr(policy, "file", None), getattr(policy, "files", None) or ()
    try:
        paths = [Path(path).absolute() for path in [*([] if one is None else [one]), *several]]
        folder = os.path.commonpath([path.parent for path in paths]) if paths else ""
        return {path.relative_to(folder).as_posix(): sized_file(path)["sha256"] for path in paths}
    except (TypeError, ValueError, UnreadableFileError) as error:
        raise ReceiptError(
            f"the policy {name_of(policy)} names files that cannot be read: {error}; its attribute"
            " files must be a list of paths, and file one"
        ) from error


def _weights(policy: Any) -> dict[str, str]:
    """Return one SHA-256 over all tensors of a network, or of each that a policy has."""
    if isinstance(policy, torch.nn.Module):
        return {"self": _tensors(policy)}
    kept: dict[str, Any] = getattr(policy, "__dict__", {})
    networks = {name: own for name, own in kept.items() if isinstance(own, torch.nn.Module)}
    return {name: _tensors(network) for name, network in sorted(networks.items())}


def _tensors(network: torch.nn.Module) -> str:
    digest = sha256()
    for name, tensor in sorted(network.state_dict().items()):
        if not isinstance(tensor, torch.Tensor):  # what a network of the user's own adds
            continue
        digest.update(f"{name} {tensor.dtype} {tuple(tensor.shape)}\n".encode())
        digest.update(tensor.detach().cpu().reshape(-1).view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()
