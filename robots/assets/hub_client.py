"""What uses of the Hugging Face Hub's client have in common: no bar of its own, its errors."""

from __future__ import annotations

from collections.abc import Mapping
from json import JSONDecodeError
from typing import Any

ENDPOINT_VARIABLE = "HF_ENDPOINT"


def silent_bar() -> type[Any]:
    """Return a progress bar for the Hub's client that shows nothing."""
    from tqdm import tqdm

    class SilentBar(tqdm):  # pyright: ignore[reportMissingTypeArgument]
        def __init__(self, *args: Any, **settings: Any) -> None:
            super().__init__(*args, **{**settings, "disable": True})

    return SilentBar


def why(error: BaseException, statuses: Mapping[int, str]) -> str:
    """Return in one line why the Hub's client failed.

    Args:
        error: What it raised.
        statuses: What HTTP errors mean here, by number.
    """
    from huggingface_hub.errors import LocalEntryNotFoundError

    if isinstance(error, LocalEntryNotFoundError) and error.__cause__ is not None:
        return why(error.__cause__, statuses)
    status = getattr(getattr(error, "response", None), "status_code", None)
    if status is not None:
        return statuses.get(status, f"HTTP error {status}")
    if isinstance(error, OSError) and error.errno:
        return f"the Hub's cache cannot be written: {error.strerror}: {error.filename}"
    if isinstance(error, JSONDecodeError):
        return "the server answers with something that is not JSON, such as a login page"
    first_line = str(error).strip().partition("\n")[0]
    return f"{type(error).__name__}: {first_line}"
