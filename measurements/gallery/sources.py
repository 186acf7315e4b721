"""What pages are made of: the catalogues, the records, and the pictures that there are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from measurements.bench import tables as bench_tables
from measurements.bench.report import Report
from measurements.gallery.record import Record
from measurements.robots.expectations import EXPECTED, read_expectations
from parity.compare import results
from robots import DescriptorError, RobotDescriptor, RobotRegistry
from robots.assets.locator import UrdfLocator
from robots.assets.manifest import AssetPackage, load_manifest
from robots.assets.packages import EXAMPLE_ROBOT_DATA
from robots.registry import CATALOGUE as ROBOTS
from tasks import MultiRobotTask, get_task_class
from tasks.registry import CATALOGUE as TASKS

MEDIA = "media"


@dataclass(frozen=True)
class Sources:
    """Everything that pages say and show, beside what descriptors and classes say.

    Attributes:
        record: What was measured for the gallery.
        parity: Task id → its comparison with native, for clones.
        versions: What that was measured with, by package.
        bench: The recorded benchmarks.
        pictures: Paths of the pictures in the gallery's folder.
    """

    record: Record
    parity: Mapping[str, Any]
    versions: Mapping[str, str]
    bench: Report
    pictures: frozenset[str]

    @classmethod
    def read(cls, record: Record, folder: Path) -> Sources:
        """Read the other records, and see which pictures are in the gallery's folder.

        Raises:
            ResultsError: If a record cannot be read.
        """
        compared = results.read()
        media = (path for path in (folder / MEDIA).rglob("*") if path.is_file())
        return cls(
            record,
            compared["tasks"],
            compared["versions"],
            bench_tables.read(),
            frozenset(path.relative_to(folder).as_posix() for path in media),
        )


def task_classes() -> dict[str, type[MultiRobotTask]]:
    """Return the tasks that come with this library, by id."""
    return {task_id: get_task_class(task_id) for task_id in TASKS}


def robots() -> dict[str, RobotDescriptor]:
    """Return the robots that come with this library, by name."""
    return {name: RobotRegistry.load(name) for name in ROBOTS}


def summary(robot: str) -> str:
    """Return what the module of a robot says of it in its first line."""
    module = import_module(ROBOTS[robot].partition(":")[0])
    return (module.__doc__ or "").splitlines()[0]


def files_of(robot: RobotDescriptor) -> tuple[AssetPackage, str]:
    """Return the package that has a robot's files, and the path of its URDF there.

    Raises:
        DescriptorError: If its files are in no package.
    """
    urdf = robot.urdf
    if not isinstance(urdf, UrdfLocator):
        raise DescriptorError(f"{robot.name}: the files of {urdf!r} are in no package")
    return load_manifest().package(urdf.package), urdf.file


def is_optional(robot: RobotDescriptor) -> bool:
    """Tell whether a robot's files are of the package that `robot-layouts[robots]` installs."""
    return files_of(robot)[0].origin.distribution == EXAMPLE_ROBOT_DATA.name


def can_be_drawn(robot: RobotDescriptor) -> bool:
    """Tell whether all its visual meshes can be had."""
    package, urdf = files_of(robot)
    return urdf not in package.undrawable


def kind(robot: RobotDescriptor) -> str:
    """Return what a robot is: ``arm``, ``several arms``, ``humanoid`` or ``hand``."""
    package, urdf = files_of(robot)
    inside = f"{package.origin.folder}/{urdf}".partition("/robots/")[2]
    known = _expectations().of(f"{package.origin.distribution}/{inside}").kind
    if known in ("humanoid", "hand"):
        return known
    return "several arms" if robot.limbs else "arm"


@cache
def _expectations() -> Any:
    return read_expectations(EXPECTED)
