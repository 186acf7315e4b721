"""What pictures vary in: each axis is seen in them, and physics knows nothing of it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

import tasks
from robot_layouts.simulation.sapien3.backend import worlds_below
from robots import TaskError, UnknownNameError
from tasks import (
    Camera,
    CameraShift,
    Light,
    Randomization,
    Surface,
    TaskEnv,
    Texture,
    Uniform,
    Whole,
)

drawing = pytest.mark.usefixtures("renderer")

CAMERA = Camera((0.3, 0.0, 0.4), (-0.1, 0.0, 0.05), width=64, height=64)
EVERYTHING = Randomization(
    cameras={
        "*": CameraShift(x=Uniform(-0.05, 0.05), roll=Uniform(-0.1, 0.1), fov=Uniform(0.8, 1.2))
    },
    lights={"*": Light(turn=Uniform(-1, 1), tilt=Uniform(0, 0.5), strength=Uniform(0.5, 1.5))},
    colors={"cube": Surface(red=Uniform(0, 1)), "arm": Surface(green=Uniform(0, 1), share=0.5)},
    textures={"table-workspace": Texture()},
)
Picture = np.ndarray


def made(randomization: Randomization | None, num_envs: int = 1, **options: Any) -> TaskEnv:
    options = {"obs_mode": "rgb+segmentation", "cameras": [CAMERA], **options}
    return tasks.make("PickCube-v1", num_envs, randomization=randomization, **options)


def seen(env: TaskEnv, seed: int = 0, texture: str = "rgb") -> Picture:
    obs, _ = env.reset(seed=seed)
    return obs["sensor_data"]["base_camera"][texture].numpy()


@pytest.fixture(scope="module")
def plain(renderer: None) -> TaskEnv:
    return made(None)


def of_body(env: TaskEnv, seed: int, body: str) -> Picture:
    """Return the pixels of a body, (K, 3)."""
    number = worlds_below(env.simulation)[0].bodies[body].entity.per_scene_id
    obs, _ = env.reset(seed=seed)
    data = obs["sensor_data"]["base_camera"]
    return data["rgb"][0].numpy()[data["segmentation"][0, ..., 0].numpy() == number]


@drawing
def test_a_camera_is_moved_turned_and_widened(plain: TaskEnv) -> None:
    env = made(
        Randomization(cameras={"base_camera": CameraShift(x=0.1, y=-0.05, yaw=0.2, fov=0.5)})
    )
    before, after = (e.reset(seed=0)[0]["sensor_param"]["base_camera"] for e in (plain, env))
    own, moved = (
        torch.cat([p["extrinsic_cv"][0], torch.tensor([[0, 0, 0, 1.0]])]) for p in (before, after)
    )
    between = (own @ torch.linalg.inv(moved)).numpy()  # in the camera's frame: z ahead, x right
    np.testing.assert_allclose(between[:3, 3], (0.05, 0.0, 0.1), atol=1e-6)
    np.testing.assert_allclose(between[:3, 2], (-np.sin(0.2), 0.0, np.cos(0.2)), atol=1e-6)
    focal = 32 / np.tan(CAMERA.fov * 0.5 / 2)
    np.testing.assert_allclose(after["intrinsic_cv"][0, 0, 0], focal, rtol=1e-6)
    np.testing.assert_allclose(after["intrinsic_cv"][0, 1, 1], focal, rtol=1e-6)
    assert (seen(env) != seen(plain)).mean() > 0.5


@drawing
def test_a_robots_camera_goes_by_the_robots_place() -> None:
    def shifted(randomization: Randomization | None) -> dict[str, torch.Tensor]:
        making = {"obs_mode": "rgb", "camera_size": (16, 16)}
        env = tasks.make("StackCube-v1", randomization=randomization, **making)
        params = env.reset(seed=0)[0]["sensor_param"]
        return {name: camera["cam2world_gl"][0] for name, camera in params.items()}

    own = shifted(None)
    moved = shifted(Randomization(cameras={"arm.hand_camera": CameraShift(x=0.02)}))
    assert torch.equal(own["base_camera"], moved["base_camera"])
    way = moved["hand_camera"] - own["hand_camera"]
    torch.testing.assert_close(way[:3, 3], -0.02 * own["hand_camera"][:3, 2])
    assert not way[:3, :3].any()


@drawing
@pytest.mark.parametrize("light", ["side", "top", "ambient"])
def test_a_light_grows_weaker(plain: TaskEnv, light: str) -> None:
    env = made(Randomization(lights={light: Light(strength=0.3, red=0.0)}))
    before, after = (seen(e)[0].astype(float) for e in (plain, env))
    dimmer = before.mean((0, 1)) - after.mean((0, 1))
    assert dimmer[0] > dimmer[1] > 2
    assert dimmer[0] > dimmer[2] > 2


@drawing
def test_light_from_elsewhere_falls_on_other_sides(plain: TaskEnv) -> None:
    """The side of the cube that faces the camera is dark until the lamp stands behind that."""
    dark = Randomization(lights={"top": Light(strength=0), "ambient": Light(strength=0.1)})
    turned = Randomization(lights={**dark.lights, "side": Light(turn=Uniform(2.3, 2.4), tilt=0.3)})
    above, ahead = (of_body(made(r), 0, "cube")[:, 0].astype(float) for r in (dark, turned))
    assert ahead.max() > above.max() * 0.5
    assert abs(ahead.mean() - above.mean()) > 10


@drawing
def test_paint_is_seen_on_what_is_painted_alone(plain: TaskEnv) -> None:
    env = made(Randomization(colors={"cube": Surface(red=0.0, green=0.0, blue=1.0)}))
    own, painted = of_body(plain, 0, "cube"), of_body(env, 0, "cube")
    assert len(own) == len(painted) > 5
    assert np.array_equal(own[:, [2, 1, 0]], painted)
    elsewhere = (seen(plain) != seen(env)).any(-1).sum()
    assert elsewhere == len(own)


@drawing
def test_some_paint_leaves_some_of_the_own_colour() -> None:
    def red(share: float) -> float:
        env = made(Randomization(colors={"cube": Surface(red=0.0, share=share)}))
        return float(of_body(env, 0, "cube")[:, 0].mean())

    assert red(0) > red(0.5) > red(1)


@drawing
@pytest.mark.parametrize("kind", ["checker", "stripes", "noise", "wood"])
def test_a_pattern_covers_a_body_in_two_colours(plain: TaskEnv, kind: str) -> None:
    texture = Texture(kinds=[kind], cells=Whole(2, 2))
    env = made(Randomization(textures={"table-workspace": texture}))
    table = of_body(env, 0, "table-workspace").astype(float)
    assert len(table) == len(of_body(plain, 0, "table-workspace")) > 500
    assert table.std(0).max() > 5
    spread = np.linalg.svd(table - table.mean(0), compute_uv=False)
    assert spread[0] > 3 * spread[1]  # along the line between its two colours


@drawing
def test_a_seed_brings_the_picture_back_in_a_world_used_again_or_rebuilt() -> None:
    env, other = made(EVERYTHING), made(EVERYTHING, 2)
    first = [seen(env, seed)[0] for seed in range(3)]
    assert all((first[0] != picture).mean() > 0.2 for picture in first[1:])
    assert np.array_equal(seen(env, 0)[0], first[0])
    obs, _ = env.reset(seed=1, options={"reconfigure": True})
    assert np.array_equal(obs["sensor_data"]["base_camera"]["rgb"][0].numpy(), first[1])
    both = seen(other, 1)
    assert np.array_equal(both[0], first[1])
    assert np.array_equal(both[1], first[2])


@drawing
def test_worlds_of_a_batch_look_different() -> None:
    """Robots of one file share nothing that is painted, nor do bodies."""
    robot = Surface(red=Uniform(0, 1), green=Uniform(0, 1), blue=Uniform(0, 1))
    env = tasks.make(
        "PickCubeSO100-v1",
        2,
        obs_mode="rgb",
        cameras=[Camera((-0.2, 0.0, 0.5), (-0.6, 0.0, 0.05), width=64, height=64)],
        randomization=Randomization(colors={"*": robot}),
    )
    before = seen(env)
    obs, _ = env.reset(seed=[5], env_ids=[1])
    after = obs["sensor_data"]["base_camera"]["rgb"].numpy()
    assert np.array_equal(before[0], after[0])
    assert (before[1] != after[1]).mean() > 0.1
    (again,) = env.simulation.look(0, env.observer.cameras, ("rgb",), markers=False)
    assert np.array_equal(again.images["rgb"], before[0])


@drawing
def test_looks_change_no_state_and_no_other_draw() -> None:
    def played(randomization: Randomization | None, obs_mode: str) -> list[np.ndarray]:
        env = made(randomization, obs_mode=obs_mode)
        env.reset(seed=3, options={"reconfigure": True})
        rng, rows = np.random.default_rng(0), []
        for _ in range(4):
            env.step(rng.uniform(-1, 1, (1, 8)).astype(np.float32))
            rows += [x.numpy() for part in env.get_state_dict().values() for x in part.values()]
        return rows

    for obs_mode in ("state", "rgb"):
        pairs = zip(played(None, obs_mode), played(EVERYTHING, obs_mode), strict=True)
        assert all(np.array_equal(before, after) for before, after in pairs)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (
            lambda: made(Randomization(cameras={"bas_camera": CameraShift(x=1)}), obs_mode="state"),
            "base_camera",
        ),
        (lambda: made(Randomization(lights={"sun": Light()}), obs_mode="state"), "ambient"),
        (lambda: made(Randomization(textures={"arm": Texture()}), obs_mode="state"), "cube"),
        (lambda: Texture(kinds=["chequer"]), "checker"),
        (lambda: Texture(kinds=()), "checker"),
        (lambda: Surface(red=2.0), "0 … 1"),
        (lambda: Randomization.from_json({"lights": {"top": {"strenght": 1}}}), "strength"),
    ],
)
def test_what_cannot_be_is_refused(wrong: Callable[[], Any], message: str) -> None:
    with pytest.raises((TaskError, UnknownNameError), match=message):
        wrong()


def test_looks_are_written_and_read() -> None:
    assert Randomization.from_json(EVERYTHING.to_json()) == EVERYTHING
    assert "textures table-workspace: checker or stripes" in str(EVERYTHING)
