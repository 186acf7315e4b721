"""Reads YAML that may come from anyone: texts, lists and mappings alone; nothing is executed."""

from __future__ import annotations

from typing import Any

import yaml


class WordLoader(yaml.SafeLoader):
    """Takes every plain word as a text: YAML 1.1 knows no 1e-3, and takes ``no`` for a flag."""

    yaml_implicit_resolvers: dict[str, Any] = {}


def compose(text: str) -> Any:
    """Return the node that a YAML text is; None if it is empty.

    Raises:
        ValueError: If it is not YAML; the message begins with the line, where that is known.
    """
    try:
        return yaml.compose(text, WordLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = "" if mark is None else f"line {mark.line + 1}: "
        problem = ", ".join(part for part in (error.context, error.problem) if part)
        raise ValueError(f"{line}this is not YAML: {problem}") from None
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        words = f"character {error.character!r} is not allowed in YAML"
        raise ValueError(f"line {line}: {words}") from None
    except RecursionError:
        raise ValueError("this is nested too deeply") from None
    except (ValueError, OverflowError) as error:  # an invalid number in a directive or escape
        raise ValueError(f"this is not YAML: {error}") from None
