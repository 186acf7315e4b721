"""The simulator behind the seam: SAPIEN 3 with PhysX on the CPU, one scene for each world."""

from robot_layouts.core.errors import MissingPackageError

try:
    import sapien as sapien
except ImportError as error:
    raise MissingPackageError(
        f"simulator='sapien3' needs SAPIEN, which cannot be imported here ({error}): pip install"
        " sapien; it has no wheels for Linux on ARM"
    ) from error
