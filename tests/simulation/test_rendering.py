"""Pictures show the world, looking changes nothing, and physics needs no graphics at all."""

import os
import subprocess
import sys

import numpy as np
import pytest
import sapien

import tasks
from robot_layouts.simulation.rendering import Cameras, vulkan_problem
from robots import SimulationError, TaskError
from tasks.registry import CATALOGUE

TASK = "TwoRobotPickCube-v1"
NO_DRIVER = {"VK_DRIVER_FILES": "/nowhere.json", "VK_ICD_FILENAMES": "/nowhere.json"}


@pytest.fixture(scope="module")
def drawn(renderer) -> tasks.MultiRobotTask:
    if problem := vulkan_problem():
        pytest.skip(problem)
    return tasks.make(TASK, num_envs=2, render_mode="rgb_array")


def red_pixels(picture: np.ndarray) -> np.ndarray:
    red, green, blue = picture.astype(int).transpose(2, 0, 1)
    return np.argwhere((red > 150) & (green < 80) & (blue < 80))


def test_every_environment_has_its_picture(drawn):
    drawn.reset(seed=3)
    pictures = drawn.render()
    assert pictures.shape == (2, 512, 512, 3)
    assert pictures.dtype == np.uint8
    assert all(picture.std() > 20 for picture in pictures)
    assert all(len(red_pixels(picture)) > 20 for picture in pictures)
    assert not np.array_equal(*pictures)


def test_the_cube_is_seen_where_it_is(drawn):
    drawn.reset(seed=3)
    camera = Cameras(drawn.simulation, (1.2, 0.0, 0.5), (0.0, 0.0, 0.02))
    columns = []
    for y in (-0.2, 0.2):
        drawn.simulation.worlds[0].set_pose("cube", (0.3, y, 0.02))
        columns.append(red_pixels(camera.take()[0])[:, 1].mean())
    assert columns[0] < 200  # left of the middle, as seen from +x
    assert columns[1] > 312


@pytest.mark.parametrize("mode", ["rgb", "state+none"])
def test_worlds_may_go_while_they_are_drawn(renderer, mode):
    for task_id in (TASK, "PickCube-v1"):
        env = tasks.make(task_id, obs_mode=mode)
        env.reset(7, {"reconfigure": True})
        env.step(env.action_space.sample())
        looking = env.observer.cameras, env.observer.mode.textures
        begun = env.simulation.begin_look(0, *looking, markers=False)
        env.close()
        del begun


@pytest.mark.long
def test_another_camera_adds_no_light(drawn):
    drawn.reset(seed=3)
    first = drawn.render()
    Cameras(drawn.simulation, (0.0, 0.0, 2.0), (0.0, 0.0, 0.0)).take()
    np.testing.assert_array_equal(drawn.render(), first)


def test_a_rebuilt_world_is_drawn_alike(drawn):
    drawn.reset(seed=3)
    first = drawn.render()
    drawn.reset(seed=3, options={"reconfigure": True})
    np.testing.assert_array_equal(drawn.render(), first)


def test_what_others_set_for_their_cameras_does_not_matter(drawn):
    """Native ManiSkill, for one, chooses other shaders and formats for the whole process."""
    drawn.reset(seed=3, options={"reconfigure": True})
    first = drawn.render()
    sapien.render.set_camera_shader_dir("minimal")
    sapien.render.set_picture_format("Color", "r8g8b8a8unorm")
    drawn.reset(seed=3, options={"reconfigure": True})
    np.testing.assert_array_equal(drawn.render(), first)


def test_worlds_without_visuals_are_refused():
    plain = tasks.make(TASK)
    with pytest.raises(SimulationError, match="visuals=True"):
        Cameras(plain.simulation, (1.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    with pytest.raises(TaskError, match="render_mode='rgb_array'"):
        plain.render()


def run_without_driver(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, **NO_DRIVER},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


@pytest.mark.long
def test_without_a_driver_every_task_runs_and_one_is_told_why_there_are_no_pictures():
    done = run_without_driver(
        "import tasks.registry, torch\n"
        "for name in tasks.registry.CATALOGUE:\n"
        "    task = tasks.make(name)\n"
        "    task.reset(seed=0, options={'reconfigure': True})\n"
        "    for _ in range(3):\n"
        "        obs, *_ = task.step(torch.zeros(1, task.layout.action_dim))\n"
        "    print(name, bool(obs.isfinite().all()))\n"
        "from robot_layouts.simulation.rendering import vulkan_problem\n"
        "print(vulkan_problem())\n"
        "tasks.make('PickCube-v1', render_mode='rgb_array')\n"
    )
    *steps, problem = done.stdout.splitlines()
    assert steps == [f"{name} True" for name in CATALOGUE], done.stderr
    assert problem.startswith("no usable Vulkan driver ("), done.stderr
    assert "SimulationError: pictures need a Vulkan driver" in done.stderr


def test_a_driver_that_does_not_answer_is_a_problem(monkeypatch):
    def hang(*args: object, timeout: float, **options: object) -> None:
        raise subprocess.TimeoutExpired("probe", timeout)

    monkeypatch.setattr(subprocess, "run", hang)
    assert "did not answer within 60 s" in (vulkan_problem.__wrapped__() or "")


def test_a_driver_that_ends_the_process_is_a_problem(monkeypatch):
    done = subprocess.CompletedProcess("probe", -6, stdout="", stderr="")
    monkeypatch.setattr(subprocess, "run", lambda *args, **options: done)
    assert "ended with code -6" in (vulkan_problem.__wrapped__() or "")
