"""Which code a task or a policy is: its name, where it can be imported, and checksums of files."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from typing import Any

import torch

from experts.registry import Expert
from robots import UnreadableFileError
from robots.common.files import open_regular
from robots.common.rooms import ROOMS
from rollouts.receipts.receipt import ReceiptError
from rollouts.sources.actors import definition, name_of
from tasks import MultiRobotTask

EXPERT, POLICY = "expert", "policy"
_MAIN = "__main__"  # a script or a notebook, which nobody can import
_CHUNK = 2**20  # bytes read at a time
_VARIABLE = re.compile(r"""\b(?:environ(?:\.get\(|\[)|getenv\()\s*["'](\w+)["']""")


def describe_task(cls: type[MultiRobotTask]) -> dict[str, Any]:
    """Return which task this is.

    It has ``id``, ``class`` (``module:Class``), ``sha256`` of that module's file, and in ``also``,
    by name, those of modules outside this library that define classes that it inherits from.
    """
    bases = {base.__module__ for base in cls.__mro__[1:-1]} - {cls.__module__}
    outside = sorted(name for name in bases if name.partition(".")[0] not in ROOMS)
    return {
        "id": cls.task_id,
        "class": f"{cls.__module__}:{cls.__qualname__}",
        "sha256": _module_checksum(cls.__module__),
        **_also(outside),
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

    Args:
        policy: What gives actions.
        name: Where it was imported from, ``module:name``; None: it is looked for.

    Raises:
        ReceiptError: If one of its files cannot be read.
    """
    found = name or _importable_name(policy)
    module, defining = (found or name_of(policy)).partition(":")[0], definition(policy).__module__
    return {
        "kind": POLICY,
        "name": found or name_of(policy),
        "importable": found is not None,
        "sha256": _module_checksum(module),
        **_also([defining] if defining != module else []),
        **_named("files", _files(policy)),
        **_named("weights", _weights(policy)),
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


def checksum(path: str | os.PathLike[str]) -> str:
    """Return the SHA-256 of a file, in hex.

    Raises:
        UnreadableFileError: If it cannot be read.
    """
    digest = sha256()
    with open_regular(path) as stream:
        while chunk := stream.read(_CHUNK):
            digest.update(chunk)
    return digest.hexdigest()


def _importable_name(policy: Any) -> str | None:
    """Return ``module:name`` by which another process finds this very thing, if there is one."""
    module = definition(policy).__module__
    if module == _MAIN or module not in sys.modules:
        return None
    names = vars(sys.modules[module])
    found = next((name for name, value in names.items() if value is policy), None)
    return None if found is None else f"{module}:{found}"


def _also(modules: Iterable[str]) -> dict[str, Any]:
    return _named("also", {name: _module_checksum(name) for name in modules})


def _named(name: str, checksums: Mapping[str, str | None]) -> dict[str, Any]:
    return {name: dict(checksums)} if checksums else {}


def _module_checksum(name: str) -> str | None:
    """Return the SHA-256 of a module that is imported; None of one without a file of its own."""
    file = getattr(sys.modules.get(name), "__file__", None)
    try:
        return None if file is None else checksum(file)
    except UnreadableFileError:  # inside an archive
        return None


def _files(policy: Any) -> dict[str, str]:
    """Return the SHA-256 of each file that a policy names, by its path below their folder."""
    one, several = getattr(policy, "file", None), getattr(policy, "files", None) or ()
    try:
        paths = [Path(path).absolute() for path in [*([] if one is None else [one]), *several]]
        folder = os.path.commonpath([path.parent for path in paths]) if paths else ""
        return {path.relative_to(folder).as_posix(): checksum(path) for path in paths}
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
    return {
        name: _tensors(value)
        for name, value in sorted(kept.items())
        if isinstance(value, torch.nn.Module)
    }


def _tensors(network: torch.nn.Module) -> str:
    digest = sha256()
    for name, tensor in sorted(network.state_dict().items()):
        if not isinstance(tensor, torch.Tensor):  # what a network of the user's own adds
            continue
        digest.update(f"{name} {tensor.dtype} {tuple(tensor.shape)}\n".encode())
        digest.update(tensor.detach().cpu().reshape(-1).view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()
