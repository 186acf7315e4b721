"""A robot's portrait: in its home posture before a plain background, as large as fits."""

from __future__ import annotations

from math import radians

import numpy as np

from kinematics.quaternions import multiplied, normalised, yaw_quaternion
from layouts import Layout, Placement
from measurements.gallery.camera import TEXTURES, Floats, Lens, Picture, shrunk
from robots import RobotDescriptor
from simulation.checks.overlaps import empty, stand
from simulation.scene.cameras import View
from simulation.simulation import Simulation

SIZE = 320  # pixels along each side
SAMPLES = 3  # pixels that are drawn for one, along each side
BRIGHTENED = 0.8  # exponent of what is drawn, so that black robots have a shape

# SAPIEN's lamps (`simulation.sapien3.pictures.studio`) shine from behind this camera, a bit from
# the right; the robot faces to the right, towards the viewer.
LENS, FACING = Lens(radians(-168), radians(18), radians(24)), radians(-120)
FARTHEST = 14.0  # m; from there, every robot is in the picture
LOOKS, COARSE = 3, 256  # to find where the camera is to be, and their size (pixels)


class Sitter:
    """A robot that is drawn; what it is drawn with lives as long as this."""

    def __init__(self, robot: RobotDescriptor) -> None:
        """Stand it in a world of its own.

        Args:
            robot: The robot.

        Raises:
            AssetError: If its files cannot be had, or it cannot be drawn.
        """
        turned = normalised(multiplied(yaw_quaternion(FACING), robot.home.quaternion))
        layout = Layout({robot.name: Placement(robot, (0.0, 0.0, 0.0), turned)})
        self._simulation = Simulation(layout, empty, 1, visuals=True)
        stand(self._simulation)

    def portrait(self) -> Picture:
        """Return its picture, (`SIZE`, `SIZE`, 3)."""
        eye = -FARTHEST * LENS.axes()[2]
        for _ in range(LOOKS):
            eye = LENS.fitted(_points(self._look(eye, COARSE)))
        view = self._look(eye, SIZE * SAMPLES)
        drawn = 255 * (view.images["rgb"] / 255.0) ** BRIGHTENED
        return shrunk(drawn.astype(np.uint8), view.images["segmentation"] != 0, SAMPLES)

    def _look(self, eye: Floats, size: int) -> View:
        cameras = {"portrait": LENS.camera(eye, size)}
        return self._simulation.look(0, cameras, TEXTURES, markers=False)[0]


def _points(view: View) -> Floats:
    """Return the places of all that a view shows, (P, 3) (m, world)."""
    seen = view.images["segmentation"][..., 0] != 0
    places = view.images["position"][seen].astype(np.float64) / 1000
    return places @ view.cam2world_gl[:3, :3].T + view.cam2world_gl[:3, 3]
