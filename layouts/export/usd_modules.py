"""The modules of usd-core, which has no types."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from robots import MissingPackageError


def usd_modules(*names: str) -> Any:
    """Return one or several modules of the package ``pxr``.

    Args:
        names: Their names, such as ``"UsdGeom"``.

    Raises:
        MissingPackageError: If usd-core is not installed.
    """
    try:
        modules = [import_module(f"pxr.{name}") for name in names]
    except ImportError as error:
        raise MissingPackageError(
            "USD stages need usd-core: pip install 'robot-layouts[usd]'"
        ) from error
    return modules if len(modules) > 1 else modules[0]
