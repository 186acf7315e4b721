"""Grasps by contact forces: along the axes in which the fingers open."""

from __future__ import annotations

import numpy as np
import pytest

import tasks
from robot_layouts.simulation.grasps import FEW, grasped
from robot_layouts.simulation.maths import Floats
from robot_layouts.simulation.sapien3.backend import worlds_below
from robots import Fingers
from robots.descriptor import Vector3
from tests.motions import touching_episode

AS_IT_IS, ROLLED = (1.0, 0.0, 0.0, 0.0), (0.5**0.5, 0.5**0.5, 0.0, 0.0)  # by 90 degrees about x


@pytest.mark.parametrize(
    ("axis", "turned", "way"),
    [
        ((0.0, 1.0, 0.0), AS_IT_IS, (0.0, 1.0, 0.0)),
        ((0.0, 0.0, 1.0), AS_IT_IS, (0.0, 0.0, 1.0)),
        ((0.0, 0.0, 2.0), ROLLED, (0.0, -1.0, 0.0)),
        ((0.0, 0.6, 0.8), AS_IT_IS, (0.0, 0.6, 0.8)),
    ],
)
def test_fingers_hold_what_presses_along_their_axes(axis, turned, way):
    fingers = Fingers(("one", "other"), max_angle=5.0, opening_axes=(axis, axis))
    press = np.array([way, (1.0, 0.0, 0.0)], np.float32)  # right in one world, wrong in the other
    poses = [np.array([(0, 0, 0, *turned)] * 2, np.float32)] * 2
    assert grasped(fingers, np.array([press, -press]), poses).tolist() == [True, False]


def _drawn(fingers: Fingers, rng: np.random.Generator, count: int) -> tuple[Floats, list[Floats]]:
    """Forces, (2, count, 3), and poses: any of both, and some within rounding of a threshold."""
    poses = rng.normal(size=(2, count, 7)).astype(np.float32)
    poses[:, ::2, 3:] /= np.linalg.norm(poses[:, ::2, 3:], axis=2, keepdims=True)
    w, u = poses[..., 3:4].astype(float), poses[..., 4:].astype(float)
    axes = np.array(fingers.opening_axes, float) * np.array(fingers.opening_signs)[:, None]
    axes = np.broadcast_to((axes / np.linalg.norm(axes, axis=1)[:, None])[:, None], u.shape)
    turn = 2 * np.cross(u, axes) / (w * w + (u * u).sum(2, keepdims=True))
    opening = axes + w * turn + np.cross(u, turn)
    aside = np.cross(opening, rng.normal(size=u.shape))
    aside /= np.linalg.norm(aside, axis=2, keepdims=True)
    off = rng.normal(size=(2, count)) * 10.0 ** rng.uniform(-9, 1, (2, count))  # degrees
    angle = np.radians(np.clip(fingers.max_angle + off, 0, 180))[..., None]
    strength = fingers.min_force + np.abs(rng.normal(size=(2, count, 1)))
    exact = rng.random((2, count)) < 0.5
    off = rng.normal(size=(2, count)) * 10.0 ** rng.uniform(-9, 0, (2, count))
    strength[exact] = (fingers.min_force * (1 + off))[exact][:, None]
    forces = strength * (np.cos(angle) * opening + np.sin(angle) * aside)
    return forces.astype(np.float32), list(poses)


@pytest.mark.parametrize("max_angle", [0.0, 0.01, 20.0, 85.0, 110.0, 180.0])
@pytest.mark.parametrize("min_force", [0.0, 0.5, 2000.0])
@pytest.mark.parametrize("axis", [(0.0, 1.0, 0.0), (0.3, -2.0, 1.0)])
def test_few_worlds_are_judged_as_many_are(max_angle: float, min_force: float, axis: Vector3):
    """Plain floats judge a few; torch, as native does, judges many at once."""
    fingers = Fingers(("one", "other"), (1, -1), min_force, max_angle, (axis, axis))
    count = 10 * FEW
    rng = np.random.default_rng([int(100 * max_angle), int(min_force), int(axis[0] * 10)])
    forces, poses = _drawn(fingers, rng, count)
    together = grasped(fingers, forces, poses)
    for first in range(0, count, FEW):
        worlds = slice(first, first + FEW)
        few = grasped(fingers, forces[:, worlds], [pose[worlds] for pose in poses])
        assert few.tolist() == together[worlds].tolist()
    for odd in (np.nan, np.inf, 1e20, 1e-25):
        forces[0, 0] = odd
        few = grasped(fingers, forces[:, :1], [pose[:1] for pose in poses])
        assert few.tolist() == grasped(fingers, forces, poses)[:1].tolist()
    poses[0][:1, 3:] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        few = grasped(fingers, forces[:, :1], [pose[:1] for pose in poses])
        assert few.tolist() == grasped(fingers, forces, poses)[:1].tolist()


def test_forces_are_the_sums_of_what_sapien_says_of_each_point():
    """Points of a contact are added up in float32, and contacts in float64, as native does."""
    env, pressed = tasks.make("PickCube-v1"), 0
    episode = touching_episode("PickCube-v1", 0)
    env.reset(0)
    (world,) = worlds_below(env.simulation)
    body, timestep = world.bodies["cube"].component, np.float32(world.physics.timestep)
    for action in episode.actions:
        env.step(action)
        for name in ("panda_leftfinger", "panda_rightfinger"):
            link, total = world.robots["arm"].links[name], np.zeros(3)
            for contact in world.system.get_contacts():
                if contact.bodies in ([link, body], [body, link]):
                    sign = 1 if contact.bodies[0] is link else -1
                    total += sign * np.sum([point.impulse for point in contact.points], axis=0)
            force = env.simulation.read().contact_force("arm", name, "cube")
            assert force.tolist() == [(total.astype(np.float32) / timestep).tolist()]
            pressed += bool(total.any())
    assert pressed >= 10
