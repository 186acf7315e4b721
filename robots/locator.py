"""Where a robot's files are on this machine."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class UrdfLocator:
    """A URDF inside a package of robot files listed in the asset manifest."""

    package: str
    file: str

    def locate(self, *, pictures: bool = False) -> Path:
        """Return the path of the URDF (provisional)."""
        from importlib.util import find_spec

        spec = find_spec("mani_skill")
        assert spec is not None and spec.origin is not None
        return Path(spec.origin).parent / "assets" / "robots" / "panda" / self.file
