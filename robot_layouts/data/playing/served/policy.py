"""A policy behind a socket: where it is, and what its server knows."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

from robot_layouts.data.actors import POLICY, Actor
from robot_layouts.data.playing.served.client import Connection, PolicyClient, VlaEvalConnection
from robot_layouts.data.playing.served.keys import PRESETS, Keys, load_keys, vla_eval
from robot_layouts.data.reading.json_files import sized_file
from robots import TaskError, unknown_name_message
from tasks import TaskEnv

_VLA_EVAL = "vla-eval+"  # before the address of a server that speaks vla-eval's protocol
_SCHEMES = ("ws", "wss", f"{_VLA_EVAL}ws", f"{_VLA_EVAL}wss")


def is_address(name: str) -> bool:
    """Return whether the name of a policy is an address."""
    return "://" in name


@dataclass(frozen=True)
class ServedPolicy:
    """A policy that another process serves; nothing is connected yet.

    Attributes:
        address: ``ws://HOST:PORT`` or ``wss://HOST:PORT`` of a server that speaks openpi's
            protocol, ``vla-eval+ws://HOST:PORT`` or ``vla-eval+wss://HOST:PORT`` of one of
            vla-eval's model servers. After ``#`` comes which keys the server knows: ``aloha``,
            ``droid`` or a YAML file; see `load_keys`. Without, openpi's is sent everything that is
            observed, and vla-eval's what `vla_eval` returns.
        name: The address without what may be secret.
        file: The file of keys, or None.
        keys: What that holds.
    """

    address: str = field(repr=False)
    name: str = field(init=False)
    file: str | None = field(init=False, default=None)
    keys: Mapping[str, Any] | str | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        """Read the keys.

        Raises:
            TaskError: If the address or the keys are invalid.
        """
        try:
            parts = urlsplit(self.address)
            sound = parts.scheme in _SCHEMES and bool(parts.hostname) and parts.port != 0
        except ValueError:  # a port that is no number
            sound = False
            parts = urlsplit("")
        if not sound:
            raise TaskError(
                f"the policy's address is {self.address!r}; it must be ws://HOST:PORT,"
                f" wss://HOST:PORT or {_VLA_EVAL}ws://HOST:PORT, and after # the keys that the"
                " server knows"
            )
        host = parts.netloc.rpartition("@")[2]
        shown = f"{parts.scheme}://{host}{parts.path}"
        own: dict[str, Any] = {"name": shown}
        if keys := parts.fragment:
            own["name"] = f"{shown}#{os.path.basename(keys)}"
            if keys in PRESETS:
                own["keys"] = keys
            elif os.path.splitext(keys)[1]:
                own |= {"file": keys, "keys": load_keys(keys)}
            else:
                raise TaskError(
                    f"{unknown_name_message('preset of keys', keys, PRESETS)} A file of keys ends"
                    " with .yaml"
                )
        vars(self).update(own)

    @property
    def actor(self) -> Actor:
        """Who acts, as a recording keeps it."""
        sha256 = None if self.file is None else sized_file(self.file)["sha256"]
        return Actor(POLICY, self.name, sha256)

    def playing(self, task: TaskEnv) -> PolicyClient:
        """Return what asks the server for the actions of a task.

        Raises:
            TaskError: If the keys do not fit the task.
            MissingPackageError: If websockets is not installed.
        """
        data = PRESETS[self.keys](task) if isinstance(self.keys, str) else self.keys
        address = self.address.partition("#")[0]
        if not address.startswith(_VLA_EVAL):
            keys = Keys(data, task)
            return PolicyClient(keys, Connection(address, self.name, keys.seconds))
        keys = Keys(data or vla_eval(task), task)
        address = address.removeprefix(_VLA_EVAL)
        return PolicyClient(keys, VlaEvalConnection(address, self.name, keys.seconds, task.task_id))
