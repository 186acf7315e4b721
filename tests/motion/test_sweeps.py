"""Without toppra a path takes as long as with it, and keeps the limits."""

import numpy as np
import pytest

from robot_layouts.core.errors import MissingPackageError
from robot_layouts.motion.timing import velocities
from robot_layouts.motion.timing.paths import Path, way


def path(seed: int, points: int, coordinates: int) -> Path:
    random = np.random.default_rng(seed)
    places = np.cumsum(random.normal(0, 0.5, (points, coordinates)), axis=0)
    speeds = random.uniform(0.5, 3.0, coordinates)
    lengths = way(places, speeds)
    blends = np.zeros(points)
    blends[1:-1] = 0.3 * np.minimum(lengths[:-1], lengths[1:])
    return Path(places, blends, speeds)


def missing() -> None:
    raise MissingPackageError("toppra is not here")


@pytest.mark.parametrize(("points", "coordinates"), [(2, 7), (5, 7), (4, 16)])
def test_it_is_as_fast_within_the_limits(points, coordinates, monkeypatch):
    run = path(points, points, coordinates)
    accelerations = 2.5 * run.speeds
    with_toppra = velocities.timed(run, accelerations)[0]
    monkeypatch.setattr(velocities, "import_toppra", missing)
    times, places, rates = velocities.timed(run, accelerations)
    assert times[-1] == pytest.approx(with_toppra[-1], abs=2 * velocities.STEP)
    np.testing.assert_array_equal(places[[0, -1]], run.points[[0, -1]])
    assert not rates[[0, -1]].any()
    assert (np.abs(rates) <= run.speeds).all()
    assert (np.abs(np.diff(rates, axis=0)) / velocities.STEP <= accelerations).all()


def test_a_path_that_does_not_move_some_joint_is_timed(monkeypatch):
    monkeypatch.setattr(velocities, "import_toppra", missing)
    run = Path(np.array([[0.0, 1.0], [1.0, 1.0]]), np.zeros(2), np.array([1.0, 1.0]))
    times, places, _ = velocities.timed(run, np.array([2.0, 2.0]))
    assert times[-1] == pytest.approx(1.5, abs=0.05)  # 0.5 s to full speed, and as long from it
    np.testing.assert_array_equal(places[:, 1], 1.0)
