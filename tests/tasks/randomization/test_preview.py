"""One picture of several draws: what it shows, and how it is asked for."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import tasks
from robot_layouts.__main__ import main
from robots import RobotLayoutsError, UnknownNameError
from tasks import Camera, CameraShift, Light, Randomization, TaskEnv, Uniform
from tasks.preview import draws, save

pytestmark = pytest.mark.usefixtures("renderer")

DIM = {"*": Light(strength=Uniform(0.2, 1.0))}
CAMERA = Camera((0.3, 0.0, 0.6), (-0.1, 0.0, 0.1), width=64, height=32)


def made(randomization: Randomization | None = None) -> TaskEnv:
    return tasks.make(
        "PickCube-v1",
        render_mode="rgb_array",
        obs_mode="none",
        cameras=[CAMERA],
        randomization=randomization,
    )


def test_every_draw_is_the_start_of_its_seed() -> None:
    env, done = made(Randomization(lights=DIM)), list[int]()
    picture = draws(env, 5, seed=3, progress=done.append)
    assert picture.shape == (2 * 256 + 4, 4 * 256 + 3 * 4, 3)
    assert done == [1, 2, 3, 4, 5]
    tiles = [picture[260 * (i // 4) :, 260 * (i % 4) :][:256, :256] for i in range(5)]
    brightness = [tile.mean() for tile in tiles]
    assert np.std(brightness) > 5
    assert np.array_equal(draws(env, 1, seed=7), tiles[4])
    assert (picture[260:, 260:] == 255).all()


def test_the_camera_that_varies_sees_them() -> None:
    env = made(Randomization(cameras={"base_camera": CameraShift(x=Uniform(-0.1, 0.1))}))
    first, second = draws(env, 1), draws(env, 1, camera="base_camera")
    assert first.shape == (256, 512, 3)
    assert np.array_equal(first, second)
    assert not np.array_equal(first, draws(made(), 1, camera="base_camera"))
    with pytest.raises(UnknownNameError, match="base_camera"):
        draws(env, 1, camera="bas_camera")


def test_what_cannot_be_drawn_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotLayoutsError, match="draws is 0"):
        draws(made(), 0)
    with pytest.raises(RobotLayoutsError, match="render_mode='rgb_array'"):
        draws(tasks.make("PickCube-v1"))
    with pytest.raises(RobotLayoutsError, match=r"\.webp"):
        save(np.zeros((4, 4, 3), np.uint8), tmp_path / "a.bmp")
    assert not list(tmp_path.iterdir())


def test_the_command_saves_a_picture(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    varied, out = tmp_path / "varied.yaml", tmp_path / "twelve.png"
    Randomization(lights=DIM).save(varied)
    words = ["preview", "PickCube-v1", "--randomization", str(varied), "--draws", "2"]
    assert main(["tasks", *words, "--out", str(out)]) == 0
    assert Image.open(out).size == (2 * 256 + 4, 256)
    assert str(out) in capsys.readouterr().out
    assert main(["tasks", *words, "--out", "picture.gif"]) == 1
    assert ".png" in capsys.readouterr().err
