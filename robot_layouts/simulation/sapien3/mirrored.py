"""Mirrored collision meshes, as files of their own.

PhysX knows no convex bodies of negative scale: it builds them, and the process crashes where two
of them touch.
"""

from __future__ import annotations

import tempfile
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from robots.urdf.mesh_files import read_corners


def unmirrored(path: str, scale: tuple[float, ...], where: str, urdf: str) -> str:
    """Return a mesh file that needs no scale, whose convex hull is that of another one scaled.

    Args:
        path: A mesh file.
        scale: Its factors along x, y and z, some of them negative.
        where: What refers to it, for messages.
        urdf: The URDF that it belongs to.

    Raises:
        AssetError: If it cannot be read.
    """
    return _written(path, Path(path).stat().st_mtime_ns, scale, where, urdf)


@lru_cache(maxsize=1024)
def _written(path: str, _modified: int, scale: tuple[float, ...], where: str, urdf: str) -> str:
    import trimesh

    hull: Any = trimesh.convex.convex_hull(read_corners(path, scale, where, urdf))
    folder = Path(_folder().name)
    target = folder / f"{len(list(folder.iterdir()))}_{Path(path).stem}.stl"
    hull.export(target)
    return str(target)


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Return a folder that is removed when this process ends."""
    return tempfile.TemporaryDirectory(prefix="robot-layouts-")
