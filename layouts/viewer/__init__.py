"""A layout as a web page: robots with their meshes, sliders, overlays, and motions to scrub."""

from layouts.viewer.cell import ShownCell, ShownMotion, Thing
from layouts.viewer.server import ViewerError

__all__ = ["ShownCell", "ShownMotion", "Thing", "ViewerError"]
