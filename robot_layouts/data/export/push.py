"""Pushes a recording or an export to the Hugging Face Hub, whole or not at all."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from robot_layouts.core.cli import Word
from robot_layouts.data.export.described import Described, card, describe, licence_for
from robot_layouts.data.reading.hub import HubError, reason, repository_and_revision
from robots.assets.sources import ENDPOINT_VARIABLE

if TYPE_CHECKING:
    from huggingface_hub import HfApi

CARD = "README.md"
_GIT = ".gitattributes"  # which the Hub writes itself
_LISTED = 5

Repository = Annotated[str, Word("OWNER/NAME")]


@dataclass(frozen=True, kw_only=True)
class Sharing:
    """How a data set is shared.

    Attributes:
        licence: Licence of the data set, as the Hub writes it: cc-by-4.0, mit (none; where pictures
            show files that are not for commercial use, cc-by-nc-4.0).
        private: Make a new repository private.
    """

    licence: Annotated[str, Word("NAME")] | None = None
    private: bool = False


@dataclass(frozen=True)
class DatasetPush:
    """A data set that can be pushed: what it is was read, and its licence allows it.

    Attributes:
        repository: ``OWNER/NAME``.
        data: The data set.
        card: The card, README.md there.
        private: Whether a new repository is private.
    """

    repository: str
    data: Described
    card: str
    private: bool

    @staticmethod
    def of(folder: str | PathLike[str], name: str, sharing: Sharing) -> DatasetPush:
        """Read a data set, and write its card; nothing is sent.

        Args:
            folder: The folder of a recording or an export.
            name: ``OWNER/NAME`` on the Hub.
            sharing: How it is shared.

        Raises:
            HubError: If the name is invalid, the folder holds no data set, or licences forbid it.
            TrajectoryError: If the data set cannot be read.
        """
        repository = checked_name(name, sharing)
        data = describe(Path(folder))
        text = card(data, repository, licence_for(data, sharing.licence))
        return DatasetPush(repository, data, text, sharing.private)

    def __call__(self) -> str:
        """Push it; returns the commit.

        Files are uploaded first, those that the Hub has already not again, and appear together in
        one commit: a push that was killed is done again, and what had arrived is not sent twice.

        Raises:
            HubError: If there is no token, the repository holds other files, or the Hub refuses.
        """
        api = _api()
        try:
            self._make_room(api)
            return self._commit(api)
        except HubError:
            raise
        except Exception as error:  # the client lets its HTTP library's errors through
            raise HubError(f"cannot push to {self.repository}: {reason(error)}") from None

    def _make_room(self, api: HfApi) -> None:
        """Make the repository, unless it is there and holds no other files."""
        api.create_repo(
            self.repository, repo_type="dataset", private=self.private or None, exist_ok=True
        )
        there = api.list_repo_files(self.repository, repo_type="dataset")
        if other := sorted({*there} - {*self.data.files, CARD, _GIT}):
            more = f" and {len(other) - _LISTED} more" if len(other) > _LISTED else ""
            raise HubError(
                f"{self.repository} holds files that this data set lacks"
                f" ({', '.join(other[:_LISTED])}{more}); choose another name, or delete them there"
            )

    def _commit(self, api: HfApi) -> str:
        from huggingface_hub import CommitOperationAdd

        files = {**self.data.files, CARD: self.card.encode()}
        done = api.create_commit(
            self.repository,
            [CommitOperationAdd(name, content) for name, content in sorted(files.items())],
            commit_message=f"{self.data.task_id}: {self.data.episodes} episodes",
            repo_type="dataset",
        )
        if self.data.version is not None:
            self._tag(api, self.data.version)
        return done.oid

    def _tag(self, api: HfApi, version: str) -> None:
        """Tag the commit with the format's version, by which LeRobot finds it."""
        refs = api.list_repo_refs(self.repository, repo_type="dataset")
        if any(tag.name == version for tag in refs.tags):
            api.delete_tag(self.repository, tag=version, repo_type="dataset")
        api.create_tag(self.repository, tag=version, repo_type="dataset")


def checked_name(name: str, sharing: Sharing) -> str:
    """Return ``OWNER/NAME``.

    Raises:
        HubError: If it is no such name or has a revision, or the licence cannot be one.
    """
    repository, revision = repository_and_revision(name)
    if revision is not None:
        raise HubError(f"{name!r} names a revision; a data set is pushed to the branch main")
    if sharing.licence is not None and not re.fullmatch(r"[a-z0-9.-]+", sharing.licence):
        raise HubError(
            f"the licence is {sharing.licence!r}; it must be one of the Hub's, such as cc-by-4.0"
        )
    return repository


def _api() -> HfApi:
    """Return the Hub's client, with the user's token.

    Raises:
        HubError: If there is no token.
    """
    from huggingface_hub import HfApi, get_token

    if get_token() is None:
        raise HubError("pushing needs a token: `hf auth login` keeps one, or set HF_TOKEN")
    return HfApi(endpoint=os.environ.get(ENDPOINT_VARIABLE), library_name="robot-layouts")


def push_command(
    folder: Annotated[Path, Word("DIR")], name: Repository, *, sharing: Sharing
) -> None:
    """Push a recording or an export to the Hugging Face Hub, with a card.

    It appears there whole. If it is stopped, the same command goes on: what has arrived is not sent
    again. Exit code: 0 if it was pushed, 1 if not, 2 for bad usage.

    Args:
        folder: The folder of a recording, or of an export.
        name: Data set on the Hub; it is made, unless it is there already.
        sharing: How it is shared.

    Raises:
        RobotLayoutsError: If it is no data set, its licences forbid it, or the Hub refuses.
    """
    report_push(DatasetPush.of(folder, name, sharing))


def report_push(push: DatasetPush) -> None:
    """Push a data set, and print where it is.

    Raises:
        HubError: See `DatasetPush`.
    """
    commit = push()
    count = len(push.data.files) + 1
    print(f"hub:{push.repository}@{commit}: {push.data.form}, {count} files")
