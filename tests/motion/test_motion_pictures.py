"""Motions drawn."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from layouts import face_to_face
from layouts.preview import COLOURS
from robot_layouts.motion import MotionError
from robot_layouts.motion.output.pictures import save_picture
from robot_layouts.motion.output.scenes import Scenes
from tests.experts.free_motions import swing

LAYOUT = face_to_face({"left": "so100", "right": "so100"}, spacing=0.6)


@pytest.fixture(scope="module")
def motion():
    return swing(LAYOUT, seconds=0.4)


def inked(picture: np.ndarray, colour: str) -> int:
    """Return how many pixels have a colour, nearly."""
    rgb = np.array([*bytes.fromhex(colour.removeprefix("#"))])
    return int((np.abs(picture.astype(int) - rgb).max(axis=-1) < 12).sum())


def test_a_still_shows_both_robots_and_what_happens(motion, tmp_path):
    path = motion.picture(tmp_path / "still.png")
    picture = np.asarray(Image.open(path).convert("RGB"))
    assert picture.shape[1] == 1200
    for colour in COLOURS[:2]:
        assert inked(picture, colour) > 500
    assert inked(picture, COLOURS[2]) < 50
    assert motion.picture(tmp_path / "still.svg").read_text().startswith("<?xml")


def test_a_moving_picture_moves(motion, tmp_path):
    counts = []
    path = save_picture(motion, tmp_path / "moving.webp", lambda *count: counts.append(count))
    with Image.open(path) as image:
        assert image.n_frames == counts[-1][1] == len(counts)
        frames = []
        for number in range(image.n_frames):
            image.seek(number)
            frames.append(np.asarray(image.convert("RGB")).astype(int))
    moved = [np.abs(frame - frames[0]).max(axis=-1) > 60 for frame in frames[1:]]
    assert 0 < 2 * moved[0].sum() < moved[-1].sum()
    assert moved[-1].sum() > 2000


def test_nothing_is_left_of_a_picture_that_cannot_be_made(motion, tmp_path):
    with pytest.raises(MotionError, match=r"'moving\.avi'; the name must end in one of \.png"):
        motion.picture(tmp_path / "moving.avi")
    assert not list(tmp_path.iterdir())


def test_what_is_drawn_is_what_the_certificate_says():
    motion = swing(face_to_face({"left": "panda", "right": "panda"}, spacing=1.4), seconds=0.8)
    scenes, certificate = Scenes(motion), motion.certify()
    distances, nearest = scenes.distances(np.linspace(0, motion.duration, 81))
    assert certificate.clearance is not None
    assert distances.min() == pytest.approx(certificate.clearance.distance, abs=1e-3)
    assert set(nearest) == set(certificate.clearance.names)
    shares = scenes.speeds(np.linspace(0, motion.duration, 200))
    assert max(map(np.max, shares.values())) == pytest.approx(certificate.velocity, rel=0.01)
    ways = scenes.tcp_ways(np.array([0.0, motion.duration]))
    assert set(ways) == {"left", "right"}
    assert np.linalg.norm(np.diff(ways["left"], axis=0)) > 0.05
