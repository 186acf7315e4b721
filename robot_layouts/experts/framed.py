"""Scripts in the frame and the lengths in which their task is declared, carried out in the world.

With other robots than its own a task that fits its robots is larger or smaller, turned and placed
elsewhere (`robot_layouts.simulation.Fit`). Numbers of a script that speaks of the declaration, such
as how far a body is lifted, fit then as well.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from robot_layouts.experts.geometry import turn
from robot_layouts.experts.grips import Grip
from robot_layouts.experts.script import Pose, Scene, Script, Waypoint
from robot_layouts.kinematics.rotations import Floats, multiply
from robot_layouts.simulation.framed import Fit, FramedState
from robots.descriptor import IDENTITY


class FramedScene(Scene):
    """A scene in the frame and the lengths of a declaration.

    Joints of robots, and the shapes in ``bodies``, are as they are in the world.
    """

    def __init__(self, scene: Scene, fit: Fit) -> None:
        """Take what the world looks like, and where the declaration lies in it."""
        vars(self).update(vars(scene))
        self._world, self._fit = scene, fit
        self._state = FramedState(scene._state, fit, {body.name: body for body in scene.bodies})

    def part(self, name: str, joint: str, position: float) -> Pose:
        """Return the pose that a part of a body has when its joint is somewhere (m or rad)."""
        (moved,) = (
            j for body in self.bodies if body.name == name for j in body.joints if j.name == joint
        )
        far = self._fit.length(position) if moved.kind == "slide" else position
        return self._declared(self._world.part(name, joint, far))

    def scale(self, name: str) -> float:
        """Return how much larger a body is in this episode than it was declared, as a factor."""
        return self._world.scale(name) / self._fit.scale

    def base(self, robot: str) -> Floats:
        """Return where the base of a robot or a limb stands, (3,)."""
        x, y, z = super().base(robot).tolist()
        return np.array(self._fit.declared((x, y, z)))

    def _between_jaws(self, robot: str, grip: Grip) -> Pose:
        return self._declared(self._world._between_jaws(robot, grip))

    def _declared(self, pose: Pose) -> Pose:
        (x, y, z), turned = pose[0].tolist(), pose[1]
        return np.array(self._fit.declared((x, y, z))), multiply(turn("z", -self._fit.yaw), turned)

    def in_world(self, pose: Pose) -> Pose:
        """Return a pose of this scene's frame, position and quaternion, in the world (m)."""
        return _placed(self._fit, *pose)


def framed(
    scripts: Callable[[Scene], Iterable[Script]], fit: Fit
) -> Callable[[Scene], Iterator[Script]]:
    """Return what makes scripts of the world that do what those of a declaration say.

    Args:
        scripts: Makes them from a `FramedScene`, which is what their waypoints look at, too.
        fit: Where the declaration lies in the world.
    """

    def made(scene: Scene) -> Iterator[Script]:
        for script in scripts(FramedScene(scene, fit)):
            yield {robot: [_framed(p, fit) for p in points] for robot, points in script.items()}

    return made


def _framed(point: Waypoint, fit: Fit) -> Waypoint:
    to, at, until, joints, share = point.to, point.at, point.until, point.joints, point.share

    def look(scene: Scene) -> FramedScene:
        return FramedScene(scene, fit)

    changed: dict[str, Callable[[Scene], object]] = {}
    if to is not None:
        changed["to"] = lambda scene: [_placed(fit, *pose) for pose in to(look(scene))]
    if at is not None:
        changed["at"] = lambda scene: _placed(fit, at(look(scene)), np.array(IDENTITY))[0]
    if until is not None:
        changed["until"] = lambda scene: until(look(scene))
    if joints is not None:
        changed["joints"] = lambda scene: joints(look(scene))
    if callable(share):
        changed["share"] = lambda scene: share(look(scene))
    return replace(point, **changed)


def _placed(fit: Fit, position: Floats, quaternion: Floats) -> Pose:
    (x, y, z), (w, i, j, k) = position.tolist(), quaternion.tolist()
    return np.array(fit.place((x, y, z))), np.array(fit.turned((w, i, j, k)))
