"""A layout for other programs: a merged URDF, and Drake's model directives."""

from layouts.export.drake import write_drake
from layouts.export.urdf import write_urdf

__all__ = ["write_drake", "write_urdf"]
