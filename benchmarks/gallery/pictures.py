"""The gallery's pictures, as WebP: portraits of robots, and clips of experts."""

from __future__ import annotations

import shutil
from copy import deepcopy
from dataclasses import dataclass, replace
from io import BytesIO
from math import atan2, ceil, cos, radians, sin, tan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

import tasks
from benchmarks.records import Record, RecordError
from layouts import Layout, Placement
from robot_layouts.core.writing import write_whole
from robot_layouts.experts import find_expert
from robot_layouts.kinematics.quaternions import multiplied, normalised, yaw_quaternion
from robot_layouts.simulation import Camera
from robot_layouts.simulation.cameras import View
from robot_layouts.simulation.checks.overlaps import empty, stand
from robot_layouts.simulation.rendering import vulkan_problem
from robot_layouts.simulation.simulation import Simulation
from robots import DescriptorError, MissingPackageError, RobotDescriptor, RobotRegistry
from robots.assets.locator import LocalUrdf, UrdfLocator
from robots.assets.manifest import EXAMPLE_ROBOT_DATA, AssetPackage, load_manifest
from robots.registry import CATALOGUE as ROBOTS
from robots.urdf.summary import parse_urdf, read_urdf
from tasks import TaskEnv
from tasks.engine.columns import overview
from tasks.episode import REBUILT, play

Floats = NDArray[np.float64]
Picture = NDArray[np.uint8]  # (H, W, 3)

BACKGROUND = (238, 241, 245)  # red, green, blue of what is empty
TEXTURES = ("rgb", "segmentation", "position")
LARGEST_PORTRAIT, LARGEST_CLIP = 25_000, 200_000  # bytes
QUALITIES = (82, 75, 65, 55, 45, 35, 25)

FRAMES_PER_SECOND, END_SHOWN = 10, 1500  # of a clip; how long its last frame stays (ms)
LONGEST = 6.0  # s of a clip; what takes longer is shown faster
CLIP_HEIGHT, CLIP_ASPECT = 240, 4 / 3
CLIP_SAMPLES = 2  # pixels that are drawn for one, along each side
ELEVATION, FIELD_OF_VIEW, CLIP_MARGIN = radians(28), radians(40), 0.08
LOWEST, FARTHEST = -0.05, 2.0  # m; what is beyond is hidden there

PORTRAIT_SIZE, PORTRAIT_SAMPLES = 320, 3  # pixels; see CLIP_SAMPLES
BRIGHTENED = 0.8  # exponent of what is drawn, so that black robots have a shape
FROM = 14.0  # m; from there, every robot is in the picture
LOOKS, COARSE = 3, 256  # to find where the camera is to be, and their size (pixels)


@dataclass(frozen=True)
class Lens:
    """From which side a camera looks, and what it takes in.

    Attributes:
        azimuth: Where it is, seen from what it looks at, about z from +x (rad).
        elevation: How high over the horizon (rad).
        fov: Its vertical field of view (rad).
        aspect: Width of its picture / height.
        margin: Share of the picture that stays empty on each side.
    """

    azimuth: float
    elevation: float
    fov: float
    aspect: float = 1.0
    margin: float = 0.06

    def axes(self) -> Floats:
        """Return what is to the right, up and ahead in its picture, (3, 3), a row each."""
        level = cos(self.elevation)
        ahead = -np.array(
            [level * cos(self.azimuth), level * sin(self.azimuth), sin(self.elevation)]
        )
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(right, ahead), ahead])

    def fitted(self, points: Floats) -> Floats:
        """Return where it is to be, as near as may be, so that it sees points (m, world).

        A point at (x, y) and depth z is in its picture if it is moved by (u, v) and w ahead, and
        |x - u| and |y - v| are at most (z - w) tan(fov / 2).

        Args:
            points: Shape (P, 3), P of 1 or more.
        """
        x, y, z = self.axes() @ points.T
        slope = tan(self.fov / 2) * (1 - 2 * self.margin)
        right, far = _centred(x, z, slope * self.aspect)
        up, farther = _centred(y, z, slope)
        return np.array([right, up, min(far, farther)]) @ self.axes()

    def camera(self, eye: Floats, height: int) -> Camera:
        """Return the camera at a place (m, world), with pictures of so many pixels' height."""
        width, name = round(height * self.aspect), f"gallery {height}"
        at, target = (tuple(place.tolist()) for place in (eye, eye + self.axes()[2]))
        return Camera(at, target, name, width, height, self.fov)


# SAPIEN's lamps (`studio`) shine from behind this camera, a bit from
# the right; the robot faces to the right, towards the viewer.
PORTRAIT, FACING = Lens(radians(-168), radians(18), radians(24)), radians(-120)


class Artist:
    """Draws and keeps pictures, all with one render system: it goes with the last world."""

    def __init__(self, record: Record, folder: Path) -> None:
        """Look whether anything can be drawn.

        Args:
            record: The gallery's, for the episodes that experts solve.
            folder: The gallery's.

        Raises:
            RecordError: If there is no Vulkan driver.
            MissingPackageError: If there is no pillow.
        """
        if (problem := vulkan_problem()) is not None:
            raise RecordError(f"no pictures can be drawn: {problem}")
        try:
            import PIL  # noqa: F401  # pyright: ignore[reportUnusedImport]
        except ImportError as error:
            words = "pictures need pillow: pip install 'robot-layouts[view]'"
            raise MissingPackageError(words) from error
        self._record, self._folder = record, folder
        self._kept: Any = None

    def draw(self, name: str) -> None:
        """Draw a robot's portrait, or film the first episode that a task's expert solves.

        Of a task without an expert, what the first episode begins with is drawn.

        Raises:
            RecordError: If the expert solved none.
            AssetError: If robot files cannot be found.
            UnwritableFileError: If the picture cannot be written.
        """
        if name not in ROBOTS:
            simulation, pictures = self._film(name)
            content, path = smallest(pictures, LARGEST_CLIP), f"media/tasks/{name}.webp"
        else:
            robot = RobotRegistry.load(name)
            with TemporaryDirectory() as folder:
                if not can_be_drawn(robot):
                    robot = seen_as_shapes(robot, Path(folder))
                simulation, picture = portrait(robot)
            content, path = smallest([picture], LARGEST_PORTRAIT), f"media/robots/{name}.webp"
        self._kept = self._kept or simulation
        write_whole(self._folder / path, content)

    def _film(self, task_id: str) -> tuple[TaskEnv, list[Picture]]:
        expert = self._record["tasks"][task_id]["expert"]
        if expert is None:
            return still(task_id)
        unsolved = set(map(int, expert["failed"]))
        seeds = [seed for seed in range(expert["episodes"]) if seed not in unsolved]
        if not seeds:
            raise RecordError(f"the expert of {task_id} solved no episode; nothing can be shown")
        return film(task_id, seeds[0])


def portrait(robot: RobotDescriptor) -> tuple[Simulation, Picture]:
    """Draw a robot in its home posture before a plain background, as large as fits.

    Returns:
        The world that it stands in, and its picture.

    Raises:
        AssetError: If its files cannot be found, or it cannot be drawn.
    """
    turned = normalised(multiplied(yaw_quaternion(FACING), robot.home.quaternion))
    layout = Layout({robot.name: Placement(robot, (0.0, 0.0, 0.0), turned)})
    simulation = Simulation(layout, empty, 1, visuals=True)
    stand(simulation)

    def look(eye: Floats, size: int) -> View:
        cameras = {"portrait": PORTRAIT.camera(eye, size)}
        return simulation.look(0, cameras, TEXTURES, markers=False)[0]

    eye = -FROM * PORTRAIT.axes()[2]
    for _ in range(LOOKS):
        view = look(eye, COARSE)
        seen = view.images["segmentation"][..., 0] != 0
        places = view.images["position"][seen].astype(np.float64) / 1000
        eye = PORTRAIT.fitted(places @ view.cam2world_gl[:3, :3].T + view.cam2world_gl[:3, 3])
    view = look(eye, PORTRAIT_SIZE * PORTRAIT_SAMPLES)
    drawn = 255 * (view.images["rgb"] / 255.0) ** BRIGHTENED
    solid = view.images["segmentation"] != 0
    return simulation, shrunk(drawn.astype(np.uint8), solid, PORTRAIT_SAMPLES)


def film(task_id: str, seed: int) -> tuple[TaskEnv, list[Picture]]:
    """Film an expert's episode, from the reset to its end.

    It is played once without a camera, to see what must be in the picture.

    Returns:
        The task, and its pictures, `FRAMES_PER_SECOND`.

    Raises:
        TaskError: If the expert finds no plan.
        AssetError: If robot files cannot be found.
    """
    planning, points = tasks.make(task_id), list[Floats]()
    try:
        actions = find_expert(task_id)(planning, seed)
        play(planning, seed, actions, lambda: points.append(_places(planning)))
    finally:
        planning.close()
    task = tasks.make(task_id, render_mode="rgb_array")
    camera = _camera(task, np.concatenate(points))
    pictures, step = list[Picture](), 0
    stride = steps_per_frame(len(actions), task.scenario.control_frequency)

    def watch() -> None:
        nonlocal step
        if step % stride == 0 or step == len(actions):
            pictures.append(_seen(task, camera))
        step += 1

    play(task, seed, actions, watch)
    return task, pictures


def still(task_id: str) -> tuple[TaskEnv, list[Picture]]:
    """Draw what the episode of seed 0 begins with.

    Returns:
        The task, and the picture, alone in a list.

    Raises:
        AssetError: If robot files cannot be found.
    """
    task = tasks.make(task_id, render_mode="rgb_array")
    task.reset(seed=0, options=REBUILT)
    return task, [_seen(task, _camera(task, _places(task)))]


def _camera(task: TaskEnv, points: Floats) -> Camera:
    """Return the camera that sees points, (n, 3) (m), from where people see the task."""
    eye, target = (overview(task.layout) if len(task.layout) == 2 else None) or task.viewpoint
    azimuth = atan2(eye[1] - target[1], eye[0] - target[0])
    lens = Lens(azimuth, ELEVATION, FIELD_OF_VIEW, CLIP_ASPECT, CLIP_MARGIN)
    return lens.camera(lens.fitted(points), CLIP_HEIGHT * CLIP_SAMPLES)


def _seen(task: TaskEnv, camera: Camera) -> Picture:
    (view,) = task.simulation.look(0, {"clip": camera}, TEXTURES[:2], markers=True)
    rgb, solid = view.images["rgb"].astype(np.uint8), view.images["segmentation"] != 0
    return shrunk(rgb, solid, CLIP_SAMPLES)


def steps_per_frame(steps: int, control_frequency: float) -> int:
    """Return how many control steps lie between two pictures of an episode of so many steps."""
    return max(
        ceil(control_frequency / FRAMES_PER_SECOND), ceil(steps / (LONGEST * FRAMES_PER_SECOND))
    )


def speed(steps: int, control_frequency: float) -> float:
    """Return how many times its real speed an episode of so many steps is shown at."""
    return steps_per_frame(steps, control_frequency) * FRAMES_PER_SECOND / control_frequency


def shrunk(rgb: NDArray[np.uint8], solid: NDArray[np.bool_], samples: int) -> Picture:
    """Return a picture of fewer pixels, each the mean of a square of them.

    Args:
        rgb: Shape (H, W, 3).
        solid: What is not background, (H, W, 1).
        samples: Pixels along each side of the square.
    """
    fine = np.where(solid, rgb, BACKGROUND)
    height, width = (n // samples for n in fine.shape[:2])
    blocks = fine.reshape(height, samples, width, samples, 3)
    return np.round(blocks.mean((1, 3))).astype(np.uint8)


def smallest(pictures: list[Picture], limit: int) -> bytes:
    """Return pictures as one WebP file of at most so many bytes, in the best quality that has it.

    Raises:
        RecordError: If it has more even in the worst quality.
    """
    from PIL import Image

    first, *others = [Image.fromarray(picture) for picture in pictures]
    moving: dict[str, Any] = {}
    if others:
        durations = [*[1000 // FRAMES_PER_SECOND] * len(others), END_SHOWN]
        moving = {"save_all": True, "append_images": others, "duration": durations, "loop": 0}
    for quality in QUALITIES:
        stream = BytesIO()
        first.save(stream, "WEBP", quality=quality, method=6, **moving)
        if len(stream.getvalue()) <= limit:
            return stream.getvalue()
    raise RecordError(f"a picture has more than {limit:,} bytes")


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
    """Tell whether all its visual meshes can be found."""
    package, urdf = files_of(robot)
    return urdf not in package.undrawable


def seen_as_shapes(robot: RobotDescriptor, folder: Path) -> RobotDescriptor:
    """Return a robot that looks like its collision shapes, as its visual meshes cannot be found.

    Args:
        robot: The robot.
        folder: Where copies of its files go.

    Raises:
        AssetError: If its files cannot be found.
    """
    source = robot.urdf.locate()
    package, urdf = files_of(robot)
    root = source.parents[len(Path(urdf).parents) - 1]
    for file in package.needed(urdf, pictures=False):
        (folder / file.path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(root / file.path, folder / file.path)
    xml = parse_urdf(read_urdf(source), urdf)
    for link in xml.iterfind("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
        for collision in link.findall("collision"):
            visual = deepcopy(collision)
            visual.tag = "visual"
            link.append(visual)
    (folder / urdf).write_bytes(ElementTree.tostring(xml))
    return replace(robot, urdf=LocalUrdf(folder / urdf))


def _centred(across: Floats, depth: Floats, slope: float) -> tuple[float, float]:
    """Return how far a camera is to move sideways, and may move ahead."""
    low, high = (across - slope * depth).max(), (across + slope * depth).min()
    return float((low + high) / 2), float((high - low) / (2 * slope))


def _places(task: TaskEnv) -> Floats:
    """Return where all links and bodies are that may move, (P, 3) (m, world)."""
    state, simulation = task.simulation.read(), task.simulation
    places = [
        state.link_position(robot, link)
        for robot in task.layout
        for link in simulation.index.links[robot]
    ]
    bodies = simulation.worlds[0].bodies
    places += [state.position(name) for name, body in bodies.items() if body.kind != "static"]
    points = np.concatenate(places).astype(np.float64)
    return points[(np.abs(points) < FARTHEST).all(1) & (points[:, 2] > LOWEST)]
