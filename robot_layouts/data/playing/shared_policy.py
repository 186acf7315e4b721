"""Policies that are shared as files: a declaration, and the weights of a network as numbers.

``policy.json`` says what is observed and what computes with that; ``weights.safetensors`` holds the
numbers. Neither is executed, so a policy may come from anyone.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save
from torch import Tensor
from torch.nn import functional
from typing_extensions import NotRequired, Self, TypedDict

from robot_layouts.core.files import read_json, read_regular
from robot_layouts.core.schema import FieldError, Name, check, exactly, whole
from robot_layouts.core.writing import write_whole
from robot_layouts.data.actors import POLICY, Actor
from robot_layouts.data.reading.hub import HubError, downloaded_policy
from robot_layouts.data.reading.json_files import sized_file
from robot_layouts.kinematics.rotations import rotation_of
from robots import TaskError, UnreadableFileError
from tasks import TaskEnv

DECLARATION, WEIGHTS = "policy.json", "weights.safetensors"
FORMAT = "robot-layouts policy 1"
OBSERVED = "state_dict"
MAX_BYTES = 2**20  # of a declaration
MAX_WEIGHTS = 2**28  # bytes of the weights
CLIP = 6.0  # standard deviations
_PICKLES = (b"PK\x03\x04", b"\x80")  # what begins files of torch.save, and other pickles
_PICKLED = (
    "it is a pickle or an archive of some, as torch.save writes; pickles can run code when they are"
    " read, and are never read here"
)


class Observed(TypedDict):
    """Part of an observation.

    Attributes:
        key: Where it is, ``extra/cube_pose``.
        symmetry: ``"cube"`` if it is the pose of a thing that looks the same after quarter turns;
            then the network is given numbers that are the same, too.
    """

    key: Name
    symmetry: NotRequired[Literal["cube"]]


class Declaration(TypedDict):
    """What ``policy.json`` says.

    Attributes:
        format: `FORMAT`.
        task: Id of the task that it has learned.
        control_mode: What its actions ask for.
        observed: What it is given, in this order.
        action_dim: How many numbers an action has.
        chunk: How many actions are predicted at once.
        played: How many of them are carried out before it looks again.
        width: Of the network's layers.
        blocks: How many pairs of layers it has.
        switches: Numbers of a chunk's actions that are -1 or 1, as of grippers.
    """

    format: Annotated[str, exactly(FORMAT)]
    task: Name
    control_mode: Name
    observed: list[Observed]
    action_dim: Annotated[int, whole(1, 1000)]
    chunk: Annotated[int, whole(1, 1000)]
    played: Annotated[int, whole(1, 1000)]
    width: Annotated[int, whole(1, 10_000)]
    blocks: Annotated[int, whole(0, 100)]
    switches: list[Annotated[int, whole(0, 10**6)]]


class SharedPolicy:
    """Plays what a network predicts: a linear fit of what is observed, and what layers add to it.

    Attributes:
        declared: What computes.
        name: Where it is from.
        files: Its files.
    """

    def __init__(
        self,
        declared: Declaration,
        weights: Mapping[str, NDArray[np.float32]],
        name: str,
        files: Sequence[Path] = (),
    ) -> None:
        """Check the weights.

        Raises:
            TaskError: If they are of another network than what is declared.
        """
        self.declared, self.name, self.files = declared, name, [*files]
        found = {key: list(tensor.shape) for key, tensor in weights.items()}
        inputs = (found.get("mean") or [0])[0]
        if (most := max(declared["switches"], default=0)) >= (found.get("unit") or [0])[0]:
            raise TaskError(f"{name}: its chunks have no number {most}, which would be a switch")
        for key, shape in _shapes(declared, inputs):
            if found.pop(key, None) != shape:
                raise TaskError(f"{name}: its weights lack a tensor {key!r} of the shape {shape}")
        if found:
            raise TaskError(f"{name}: nothing is declared that computes with {sorted(found)[0]!r}")
        self._weights = {key: torch.from_numpy(tensor) for key, tensor in weights.items()}
        self._left = list[Tensor]()

    @classmethod
    def load(cls, folder: str | PathLike[str], name: str | None = None) -> Self:
        """Load what `save_policy` wrote.

        Args:
            folder: The folder.
            name: Where that is from; the folder, if not given.

        Raises:
            TaskError: If it is no policy, or its files cannot be read.
        """
        declaration, weights = (Path(folder) / part for part in (DECLARATION, WEIGHTS))
        try:
            declared = check(read_json(declaration, MAX_BYTES), Declaration, "")
            tensors = read_tensors(weights)
        except (UnreadableFileError, FieldError) as error:
            raise TaskError(f"{name or folder} is no policy: {error}") from error
        return cls(declared, tensors, name or str(folder), [declaration, weights])

    @property
    def actor(self) -> Actor:
        """Who acts, as a recording keeps it."""
        weights = [sized_file(file)["sha256"] for file in self.files if file.name == WEIGHTS]
        return Actor(POLICY, self.name, weights[0] if weights else None)

    def playing(self, task: TaskEnv) -> Self:
        """Return it as it acts in a task.

        Raises:
            TaskError: If it plays in another control mode, observes otherwise, or has other
                actions.
        """
        mode = self.declared["control_mode"]
        if (task.control_mode, task.obs_mode) != (mode, OBSERVED):
            raise TaskError(
                f"{self.name} plays in control_mode={mode!r} and observes obs_mode={OBSERVED!r},"
                f" not {task.control_mode!r} and {task.obs_mode!r}; on the command line, add"
                f" --control-mode {mode} --obs-mode {OBSERVED}"
            )
        if (numbers := task.layout.action_dim) != self.declared["action_dim"]:
            raise TaskError(
                f"{self.name} has learned {self.declared['task']}, with actions of"
                f" {self.declared['action_dim']} numbers; those of {task.task_id} have {numbers}"
            )
        return self

    @torch.no_grad()
    def __call__(self, observation: Mapping[str, Any]) -> Tensor:
        """Return the next action, (A,), after an observation of one environment.

        Raises:
            TaskError: If it lacks something that is declared.
        """
        if not self._left:
            parts = [self._part(observation, about) for about in self.declared["observed"]]
            seen, count = torch.cat(parts), len(self._weights["mean"])
            if len(seen) != count:
                raise TaskError(f"{self.name} observes {count} numbers; here are {len(seen)}")
            chunk = self._chunk(seen[None]).reshape(self.declared["chunk"], -1)
            self._left = [*chunk[: self.declared["played"]]]
        return self._left.pop(0)

    def _part(self, observation: Mapping[str, Any], about: Observed) -> Tensor:
        part: Any = observation
        for word in about["key"].split("/"):
            part = part.get(word) if isinstance(part, Mapping) else None
        if not isinstance(part, Tensor):
            raise TaskError(f"{self.name} observes {about['key']!r}, which is not observed here")
        if "symmetry" not in about:
            return part.reshape(-1).float()
        if part.shape != (1, 7):
            raise TaskError(f"{self.name} takes {about['key']!r} for the pose of a cube")
        turned = torch.from_numpy(rotation_of(part[0, 3:].numpy())).float()
        return torch.cat([part[0, :3], (turned**3 @ turned.mT).flatten()])

    def _chunk(self, seen: Tensor) -> Tensor:
        """Return the next actions, (1, chunk · A)."""
        weights, blocks = self._weights, self.declared["blocks"]
        seen = ((seen - weights["mean"]) / weights["scale"]).clamp(-CLIP, CLIP)
        x = self._layer(seen, "network.0")
        for block in range(1, blocks + 1):
            name = f"network.{block}.layers"
            inner = self._layer(self._normalised(x, f"{name}.0"), f"{name}.1")
            x = x + self._layer(functional.gelu(inner), f"{name}.3")
        added = self._layer(self._normalised(x, f"network.{blocks + 1}"), f"network.{blocks + 2}")
        chunk = self._layer(seen, "linear") + weights["unit"] * added
        switches = self.declared["switches"]
        chunk[:, switches] = chunk[:, switches].sign()
        return chunk

    def _layer(self, x: Tensor, name: str) -> Tensor:
        return functional.linear(x, self._weights[f"{name}.weight"], self._weights[f"{name}.bias"])

    def _normalised(self, x: Tensor, name: str) -> Tensor:
        weight, bias = self._weights[f"{name}.weight"], self._weights[f"{name}.bias"]
        return functional.layer_norm(x, (x.shape[1],), weight, bias)


def hub_policy(name: str) -> SharedPolicy:
    """Load a policy from the Hugging Face Hub; its name is that of the commit that was found.

    Args:
        name: ``hub:OWNER/NAME`` or ``hub:OWNER/NAME@REVISION``.

    Raises:
        HubError: If it cannot be downloaded.
        TaskError: If it is no policy of this library's.
    """
    folder = downloaded_policy(name, (DECLARATION, WEIGHTS))
    if not (folder / DECLARATION).is_file():
        raise HubError(
            f"{name} holds no {DECLARATION}, by which a policy of this library's says what computes"
            " with its weights; pickles (.pt, .pth, .pkl, .bin) can run code when they are read,"
            " and are never read"
        )
    return SharedPolicy.load(folder, f"{name.partition('@')[0]}@{folder.name}")


def save_policy(
    folder: str | PathLike[str],
    declared: Declaration,
    weights: Mapping[str, NDArray[np.float32]],
) -> SharedPolicy:
    """Write a policy to a folder, and load it from there.

    Raises:
        TaskError: If the weights are of another network than what is declared.
        UnwritableFileError: If it cannot be written.
    """
    SharedPolicy(declared, weights, str(folder))
    write_tensors(Path(folder) / WEIGHTS, weights)
    write_whole(Path(folder) / DECLARATION, json.dumps(declared, indent=1) + "\n")
    return SharedPolicy.load(folder)


def read_tensors(path: str | PathLike[str]) -> dict[str, NDArray[np.float32]]:
    """Return the tensors of a file by name; nothing in it is executed.

    Raises:
        UnreadableFileError: If it cannot be read, is larger than 256 MB, a pickle, not in that
            format, or has other numbers than finite ones of 32 bits.
    """
    content = read_regular(path, MAX_WEIGHTS)
    if content.startswith(_PICKLES):
        raise UnreadableFileError(path, _PICKLED)
    try:
        tensors = load(content)
    except (SafetensorError, KeyError) as error:  # KeyError: a type that NumPy lacks
        raise UnreadableFileError(path, f"it is no safetensors file: {error}") from error
    for name, tensor in tensors.items():
        if tensor.dtype != np.float32 or not np.isfinite(tensor).all():
            raise UnreadableFileError(
                path, f"{name!r} has other numbers than finite ones of 32 bits"
            )
    return tensors


def write_tensors(path: str | PathLike[str], tensors: Mapping[str, NDArray[np.float32]]) -> None:
    """Write tensors of 32 bits by name.

    Raises:
        UnwritableFileError: If it cannot be written.
    """
    write_whole(path, save({name: np.array(x, order="C") for name, x in tensors.items()}))


def _shapes(declared: Declaration, inputs: int) -> Iterator[tuple[str, list[int]]]:
    """Yield the name and the shape of each tensor of a network."""
    width, blocks = declared["width"], declared["blocks"]
    outputs = declared["chunk"] * declared["action_dim"]
    layers = {"linear": (inputs, outputs), "network.0": (inputs, width)}
    norms = [f"network.{blocks + 1}"]
    for block in range(1, blocks + 1):
        norms.append(f"network.{block}.layers.0")
        layers |= {f"network.{block}.layers.{i}": (width, width) for i in (1, 3)}
    layers[f"network.{blocks + 2}"] = (width, outputs)
    yield from (("mean", [inputs]), ("scale", [inputs]), ("unit", [outputs]))
    for name, (before, after) in layers.items():
        yield f"{name}.weight", [after, before]
        yield f"{name}.bias", [after]
    for name in norms:
        yield f"{name}.weight", [width]
        yield f"{name}.bias", [width]
