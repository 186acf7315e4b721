"""How a report is written: a template, a style and a script, and clips inside the page."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from parity.show.embedding import Embedded
from robots import MissingPackageError
from robots.common.pages import data_address, read_style, source_hash


def render(context: Mapping[str, Any], fitted: Mapping[str, Embedded]) -> str:
    """Return the page.

    Args:
        context: What it says.
        fitted: Clip of a task by its id.

    Raises:
        MissingPackageError: If jinja2 is not installed.
    """
    try:
        import jinja2
    except ImportError:
        raise MissingPackageError("a page needs jinja2: pip install jinja2") from None
    folder = files("parity.report") / "templates"
    parts = {
        name: (folder / f"report.{suffix}").read_text(encoding="utf-8")
        for name, suffix in (("page", "html.jinja"), ("script", "js"))
    }
    style = read_style(("parity.report", "templates/report.css"))
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    shown = [{**task, "clip": _clip(task, fitted.get(task["id"]))} for task in context["tasks"]]
    return environment.from_string(parts["page"]).render(
        {
            **context,
            "tasks": shown,
            "style": style,
            "script": parts["script"],
            "policy": _policy(style, parts["script"]),
        }
    )


def _clip(task: Mapping[str, Any], clip: Embedded | None) -> dict[str, Any] | None:
    if clip is None:
        return None
    label = f"{task['id']}: native ManiSkill, the clone and their difference, side by side"
    return {
        "label": label,
        "caption": task["caption"],
        "source": data_address("video/mp4", clip.video),
        "poster": data_address("image/jpeg", clip.poster),
        "width": clip.width,
        "height": clip.height,
    }


def _policy(style: str, script: str) -> str:
    """Return a policy under which a browser loads nothing but what the page itself carries."""
    own = f"style-src {source_hash(style)}; script-src {source_hash(script)}"
    return f"default-src 'none'; img-src data:; media-src data: blob:; {own}; form-action 'none'"
