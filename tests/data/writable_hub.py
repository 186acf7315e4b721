"""A stand-in for the Hugging Face Hub on the loopback address that takes data sets and models.

What it answers is what the client of huggingface_hub asks when one is made, pushed and read.
"""

from __future__ import annotations

import base64
import hashlib
import json
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock
from urllib.parse import unquote, urlsplit

from huggingface_hub import constants

from robot_layouts.data.reading import hub as reading
from tests.robots.hub_server import Handler, HubServer

TOKEN = "hf_must_never_be_printed"
LARGE = (".h5", ".hdf5", ".parquet", ".mp4", ".safetensors")  # what goes by LFS


@dataclass
class Repository:
    """A data set or a model: its commits, the last of which is main, and its tags."""

    commits: dict[str, dict[str, bytes]] = field(default_factory=dict)
    tags: dict[str, str] = field(default_factory=dict)

    def commit(self, files: dict[str, bytes]) -> str:
        text = repr([len(self.commits), sorted(files.items())]).encode()
        self.head = hashlib.sha1(text).hexdigest()
        self.commits[self.head] = files
        return self.head

    def find(self, revision: str) -> str | None:
        names = {"main": self.head, **self.tags, **{name: name for name in self.commits}}
        return names.get(revision)


@dataclass
class WritableHub(HubServer):
    """Data sets by ``OWNER/NAME``, and what was uploaded.

    Attributes:
        repositories: The data sets.
        objects: Contents of large files by their SHA-256.
        reached: Set when so many large files have arrived as `stop_after` says; then no more do.
    """

    repositories: dict[str, Repository] = field(default_factory=dict)
    objects: dict[str, bytes] = field(default_factory=dict)
    stop_after: int | None = None
    reached: threading.Event = field(default_factory=threading.Event)

    def uploads(self) -> list[str]:
        """Return the SHA-256 of each large file that was sent, in order."""
        return [path.rpartition("/")[2] for method, path in self.requests if method == "PUT"]


class _WritableHandler(Handler):
    def do_POST(self) -> None:
        self._change("POST")

    def do_PUT(self) -> None:
        self._change("PUT")

    def do_DELETE(self) -> None:
        self._change("DELETE")

    def _change(self, method: str) -> None:
        hub: WritableHub = self.server.hub
        path = unquote(urlsplit(self.path).path)
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        fault = hub.fault_for(method, path)
        if fault is not None:
            fault(self, b"")
            return
        if method == "PUT":
            self._store(path, body)
            return
        hub.requests.append((method, path))
        if self.headers.get("Authorization") != f"Bearer {TOKEN}":
            self.send_error_code(401, None)
        elif path == "/api/validate-yaml":
            self.send_json({"errors": [], "warnings": []})
        elif path == "/api/repos/create":
            self._create(json.loads(body))
        elif found := re.fullmatch(r"(?:/datasets)?/(.+)\.git/info/lfs/objects/batch", path):
            self._batch(json.loads(body)["objects"])
        elif found := re.fullmatch(r"/api/(?:datasets|models)/([^/]+/[^/]+)/(\w+)/(.+)", path):
            answer = {"preupload": self._modes, "commit": self._commit, "tag": self._tag}[found[2]]
            answer(hub.repositories[found[1]], found[1], body)
        else:
            self.send_error_code(404, None)

    def _create(self, wanted: dict[str, Any]) -> None:
        hub: WritableHub = self.server.hub
        name = f"{wanted['organization']}/{wanted['name']}"
        there = name in hub.repositories
        if not there:
            hub.repositories[name] = Repository()
            hub.repositories[name].commit({".gitattributes": b"*.h5 filter=lfs\n"})
        body = json.dumps({"url": f"{hub.endpoint}/datasets/{name}"}).encode()
        self._send(409 if there else 200, body, {"Content-Type": "application/json"})

    def _modes(self, repository: Repository, name: str, body: bytes) -> None:
        files = [
            {
                "path": file["path"],
                "uploadMode": "lfs" if file["path"].endswith(LARGE) else "regular",
                "shouldIgnore": False,
            }
            for file in json.loads(body)["files"]
        ]
        self.send_json({"files": files})

    def _batch(self, wanted: list[dict[str, Any]]) -> None:
        hub: WritableHub = self.server.hub
        objects = [dict(one) for one in wanted]
        for one in objects:
            if one["oid"] not in hub.objects:
                one["actions"] = {"upload": {"href": f"{hub.endpoint}/lfs/{one['oid']}"}}
        self.send_json({"transfer": "basic", "objects": objects})

    def _store(self, path: str, body: bytes) -> None:
        hub: WritableHub = self.server.hub
        name = path.rpartition("/")[2]
        if hub.stop_after is not None and len(hub.objects) >= hub.stop_after:
            hub.reached.set()
            self.rfile.read(1)  # returns when the client goes away
            return
        assert hashlib.sha256(body).hexdigest() == name
        hub.requests.append(("PUT", path))
        hub.objects[name] = body
        self.send_json({})

    def _commit(self, repository: Repository, name: str, body: bytes) -> None:
        hub: WritableHub = self.server.hub
        files = dict(repository.commits[repository.head])
        for line in body.splitlines():
            entry = json.loads(line)
            value = entry["value"]
            if entry["key"] == "file":
                files[value["path"]] = base64.b64decode(value["content"])
            elif entry["key"] == "lfsFile":
                files[value["path"]] = hub.objects[value["oid"]]
        commit = repository.commit(files)
        self.send_json(
            {"commitUrl": f"{hub.endpoint}/datasets/{name}/commit/{commit}", "commitOid": commit}
        )

    def _tag(self, repository: Repository, name: str, body: bytes) -> None:
        if self.command == "DELETE":
            del repository.tags[self.path.rpartition("/")[2]]
        else:
            repository.tags[json.loads(body)["tag"]] = repository.head
        self.send_json({})

    def _answer(self, method: str) -> None:
        hub: WritableHub = self.server.hub
        path = unquote(urlsplit(self.path).path)
        hub.requests.append((method, path))
        fault = hub.fault_for(method, path)
        kind, name = r"(?:(?:/api)?/datasets|/api/models|)", r"([^/]+/[^/]+)"
        found = re.fullmatch(rf"{kind}/{name}/(\w+)(?:/([^/]+))?(?:/(.+))?", path)
        repository = hub.repositories.get(found[1]) if found else None
        if fault is not None:
            fault(self, b"")
        elif found is None or repository is None:
            self.send_error_code(404, "RepoNotFound")
        elif found[2] == "refs":
            tags = [{"name": n, "ref": n, "targetCommit": c} for n, c in repository.tags.items()]
            self.send_json({"branches": [], "converts": [], "tags": tags})
        elif (commit := repository.find(found[3])) is None:
            self.send_error_code(404, "RevisionNotFound")
        else:
            self._show(found, commit, repository.commits[commit])

    def _show(self, found: re.Match[str], commit: str, files: dict[str, bytes]) -> None:
        if found[2] == "revision":
            self.send_json({"id": found[1], "sha": commit})
        elif found[2] == "tree":
            entries = [
                {
                    "type": "file",
                    "path": path,
                    "size": len(data),
                    "oid": hashlib.sha1(data).hexdigest(),
                }
                for path, data in sorted(files.items())
            ]
            self.send_json(entries)
        elif found[4] in files:
            data = files[found[4]]
            headers = {
                "ETag": f'"{hashlib.sha1(data).hexdigest()}"',
                "X-Repo-Commit": commit,
                "Content-Type": "application/octet-stream",
            }
            self._send(200, data, headers)
        else:
            self.send_error_code(404, "EntryNotFound")


WritableHub.handler = _WritableHandler


@contextmanager
def running_hub(folder: Path, **settings: object) -> Iterator[WritableHub]:
    """Run a Hub that this process finds, with a token, and a cache of its own in a folder.

    Args:
        folder: Where the client keeps what it has read.
        settings: More constants of the client, such as how long it waits.
    """
    with WritableHub({}) as server:
        places = {"HF_HOME": str(folder / "hf_home"), "HF_ENDPOINT": server.endpoint}
        own = {"HF_HUB_DISABLE_XET": "1", "HF_TOKEN": TOKEN, "NO_PROXY": "127.0.0.1", **places}
        cache = {"HF_HUB_CACHE": str(folder / "hf_home/hub"), "HF_HUB_DISABLE_XET": True}
        reading._downloaded.cache_clear()
        with (
            mock.patch.dict("os.environ", own),
            mock.patch.multiple(constants, **cache, **settings),
        ):
            yield server
