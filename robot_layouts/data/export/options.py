"""What an export is asked for, and what is refused before anything is read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from os import PathLike
from pathlib import Path

from layouts import Layout
from layouts.placement import RobotLike
from robot_layouts.core.bounds import shown
from robot_layouts.data.export.folder import refuse_used
from robots import MissingPackageError, TaskError, UnknownNameError
from tasks.engine.cameras import Size, checked_size
from tasks.engine.columns import OVERVIEW

FORMATS = ("lerobot", "robomimic")
INSTALL = "pip install 'robot-layouts[export]'"


@dataclass(frozen=True)
class Export:
    """What is exported, and as what.

    Attributes:
        recording: An h5 file, ours or native's, with its json beside it, or a recording's folder.
        format: ``"lerobot"`` or ``"robomimic"``.
        out: Folder of the dataset; it must be new or empty.
        fps: Control steps per second that the dataset states (``"lerobot"`` only); those of the
            task if None.
        video: Whether pictures are drawn and written as videos (``"lerobot"`` only); those of the
            overview unless ``cameras`` says more.
        include_failures: Whether episodes whose last step is no success are exported, too.
        task: The recording's task; ``module:Id`` for one of a module that no package lists.
        layout: Where its robots stood, where the recording cannot say it.
        robots: Which robots these were, where the recording cannot say it.
        cameras: Which cameras' pictures are drawn: names by place such as ``"base_camera"`` and
            ``"left.hand_camera"``, ``"overview"``, or ``"all"`` for those of the task and its
            robots. Videos in a LeRobot dataset, arrays in a robomimic one.
        images: Whether a LeRobot dataset holds png images, which lose nothing, in place of videos.
        depth: Whether the cameras of the task and its robots tell of depth, too (mm, 16 bits); in
            a LeRobot dataset always as png images.
        size: Width and height of their pictures (pixels); None: each camera's own.
        instruction: What is to be done, in a sentence: of all episodes, or by ``episode_id``. Those
            without have their source's (``"instruction"`` in `Trajectory.source`), else their
            task's.
    """

    recording: str | PathLike[str]
    format: str
    out: str | PathLike[str]
    fps: int | None = None
    video: bool = False
    include_failures: bool = False
    task: str | None = None
    layout: Layout | None = None
    robots: Mapping[str, RobotLike] | None = None
    cameras: str | Sequence[str] | None = None
    images: bool = False
    depth: bool = False
    size: Size | None = None
    instruction: str | Mapping[int, str] | None = None

    @property
    def camera_names(self) -> tuple[str, ...]:
        """Which cameras' pictures are drawn; none if there are no pictures."""
        if self.cameras is None:
            return (OVERVIEW,) if self.video else ()
        return (self.cameras,) if isinstance(self.cameras, str) else tuple(self.cameras)

    def check(self, *, here: bool = True) -> None:
        """Refuse what cannot be done.

        Args:
            here: Whether this machine draws the pictures; others say themselves if they cannot.

        Raises:
            UnknownNameError: If there is no such format.
            TaskError: If options do not go together.
            MissingPackageError: If a package that they need is not installed.
            SimulationError: If there is no Vulkan driver to draw pictures with.
            RecordingError: If the folder holds something already.
        """
        if self.format not in FORMATS:
            raise UnknownNameError("export format", self.format, FORMATS)
        if self.fps is not None and self.fps < 1:
            raise TaskError(f"fps is {self.fps}; it must be 1 or more")
        if self.format == "lerobot" and find_spec("pyarrow") is None:
            raise MissingPackageError(f"LeRobot datasets need pyarrow: {INSTALL}")
        if self.format == "robomimic":
            self._expect_robomimic()
        self._expect_pictures(here=here)
        refuse_used(Path(self.out))

    def _expect_robomimic(self) -> None:
        for what in ("video", "images", "fps"):
            if getattr(self, what) not in (None, False):
                words = "" if what == "fps" else "cameras, whose pictures it holds, or "
                raise TaskError(
                    f"a robomimic dataset has no {what} here; leave it out, or choose"
                    f" {words}lerobot"
                )

    def _expect_pictures(self, *, here: bool) -> None:
        names = self.camera_names
        if not all(isinstance(name, str) for name in names):
            raise TaskError(f"cameras are {shown(self.cameras)}; their names are needed")
        if self.cameras is None:
            for what in ("images", "depth", "size"):
                if getattr(self, what) not in (None, False):
                    raise TaskError(f"{what} is of no use without cameras; choose some, or 'all'")
        elif not names:
            raise TaskError("no camera is named; leave cameras out, or name some")
        if self.video and self.images:
            raise TaskError("pictures are either a video or images; choose one of them")
        if self.size is not None:
            checked_size("size", self.size)
        if names:
            from robot_layouts.data.export.pictures import require_pictures

            lerobot = self.format == "lerobot"
            require_pictures(
                video=lerobot and not self.images,
                images=lerobot and (self.images or self.depth),
                driver=here,
                without="video" if self.cameras is None else "cameras",
            )
