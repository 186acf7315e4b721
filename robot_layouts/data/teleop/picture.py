"""The live picture of a task: its robots and bodies, and the first camera pose."""

from __future__ import annotations

from typing import Any

import numpy as np

from layouts.viewer.scene import COARSE, CellScene
from robot_layouts.data.teleop.session import Session
from robot_layouts.kinematics.rotations import Floats
from tasks.view import live_thing, task_cell

FIELD_OF_VIEW = np.radians(60)  # from the upper to the lower edge
VIEW, NEAREST = (0.9, -0.55, 0.6), 0.9  # from the TCPs to the camera: direction, and least way (m)


class Picture:
    """A session's world on a viser server.

    Attributes:
        notes: Remarks on the robots' files, for a person.
    """

    def __init__(self, server: Any, session: Session) -> None:
        """Draw the world as it is, and let cameras begin at `viewpoint`.

        Args:
            server: A viser server.
            session: What is shown.
        """
        self._session = session
        cell = task_cell(session.task, session.task.task_id)
        self.notes = cell.notes
        server.scene.set_up_direction("+z")
        self._scene = CellScene(server.scene, cell, drawn=("meshes", COARSE))
        self.hurry = self._scene.hurry
        camera = server.initial_camera
        camera.fov = FIELD_OF_VIEW
        camera.position, camera.look_at = viewpoint(session)
        self._shapes = {name: body.shapes for name, body in self._bodies.items()}
        self._shown: dict[str, Floats] = {}
        self.show()

    def show_anew(self) -> None:
        """Show a world that was built anew, whose bodies may have other shapes."""
        for name, body in self._bodies.items():
            if body.shapes != self._shapes.get(name):
                thing = live_thing(self._session.task, name)
                if thing is not None:
                    self._scene.draw(name, thing)
                self._shapes[name] = body.shapes
        self._shown.clear()
        self.show()

    def show(self) -> None:
        """Show where robots and bodies are; what has not moved is not sent again."""
        state = self._session.task.simulation.read()
        for name in self._session.task.layout:
            if self._moved(f"base of {name}", base := state.base_pose(name)[0]):
                self._scene.stand(name, base.astype(float))
            if self._moved(f"joints of {name}", qpos := state.qpos(name)[0]):
                self._scene.pose(name, qpos.astype(float))
        for name in self._scene.things:
            if self._moved(f"body {name}", pose := state.pose(name)[0]):
                self._scene.place(name, pose.astype(float))

    # -- inside ------------------------------------------------------------------------------

    @property
    def _bodies(self) -> Any:
        return self._session.task.simulation.worlds[0].bodies

    def _moved(self, what: str, now: Floats) -> bool:
        before = self._shown.get(what)
        self._shown[what] = now.copy()
        return before is None or not np.array_equal(before, now)


def viewpoint(session: Session) -> tuple[Floats, Floats]:
    """Return the first place of the camera, and its target amid the TCPs; each (3,) (m, world)."""
    places = np.array([pose[:3] for pose in session.targets.values()])
    middle = places.mean(axis=0)
    distance = NEAREST + 1.2 * float(np.linalg.norm(np.ptp(places, axis=0)))
    return middle + distance * np.array(VIEW) / np.linalg.norm(VIEW), middle
