"""What stands still is drawn once: pictures are those of everything drawn at once, to the bit."""

from contextlib import closing

import numpy as np
import pytest

import tasks
from layouts import single
from robot_layouts.simulation import Box, Camera, Simulation, World
from robot_layouts.simulation.cameras import SHADERS
from robot_layouts.simulation.sapien3.backdrop import LAYERED
from robot_layouts.simulation.sapien3.backend import worlds_below
from robot_layouts.simulation.sapien3.studio import Studio
from tests.quick import quick_cases

pytestmark = pytest.mark.usefixtures("drawn")

CAMERAS = {
    "front": Camera((0.3, 0.0, 0.6), (-0.1, 0.0, 0.1), "front", 61, 47),
    "side": Camera((-0.3, 1.0, 0.4), (-0.3, 0.0, 0.2), "side", 80, 80, fov=0.8),
    "away": Camera((-0.9, 0.0, 0.5), (-2.0, 0.0, 0.0), "away", 32, 32),
}
RED, GREEN, GLASS = (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0), (0.0, 0.0, 1.0, 0.5)
HALF = (0.05, 0.05, 0.05)
PLACE = (-0.1, 0.0, 0.05)


def built(*colors, kinds=("static", "dynamic"), apart: float = 0.2) -> Simulation:
    """A Panda and boxes in a row along y, ``apart`` m from one to the next."""

    x, _, z = PLACE

    def build(world: World, _: int) -> None:
        for i, (color, kind) in enumerate(zip(colors, kinds, strict=True)):
            world.add(f"box{i}", Box(HALF, color=color), kind=kind, position=(x, i * apart, z))

    simulation = Simulation(single({"arm": "panda"}), build, 1, visuals=True)
    for name, placement in simulation.layout.items():
        simulation.worlds[0].stand(name, placement.start_qpos)
    return simulation


def studio_of(simulation: Simulation) -> Studio:
    return worlds_below(simulation)[0].studio


def pictures(simulation: Simulation, *, layered: bool, cameras=CAMERAS) -> list[np.ndarray]:
    """All textures of all cameras, on a backdrop or drawn at once."""
    simulation.look(0, cameras, ("rgb",), markers=False)  # which sets the studio up
    bodies = studio_of(simulation)._bodies
    solid, bodies.solid = bodies.solid, bodies.solid and layered
    views = simulation.look(0, cameras, SHADERS[LAYERED], markers=False)
    bodies.solid = solid
    return [view.images[texture] for view in views for texture in SHADERS[LAYERED]]


def expect_same(simulation: Simulation) -> None:
    both = [pictures(simulation, layered=layered) for layered in (True, False)]
    for laid, whole in zip(*both, strict=True):
        np.testing.assert_array_equal(laid, whole)


def whole_pictures(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Count for how many cameras everything is drawn at once, each time that it is."""
    found: list[int] = []
    whole = Studio._whole
    monkeypatch.setattr(
        Studio, "_whole", lambda *args: (found.append(len(args[1])), whole(*args))[1]
    )
    return found


@pytest.mark.parametrize(
    "task_id",
    quick_cases(
        ["PickCube-v1", "PushT-v1", "PickCubeSO100-v1", "TwoRobotStackCube-v1", "DrawTriangle-v1"],
        ["PickCube-v1"],
    ),
)
def test_a_picture_of_parts_is_that_of_the_whole(task_id: str):
    with closing(tasks.make(task_id, render_mode="rgb_array")) as env:
        random = np.random.default_rng(0)
        for seed in range(2):
            env.reset(seed=seed)
            for _ in range(2):
                env.step(random.uniform(-1, 1, (1, *env.single_action_space.shape)))
                expect_same(env.simulation)


def test_a_hand_s_camera_draws_only_what_is_before_it():
    hand = {"arm": "panda_wristcam"}
    with closing(tasks.make("PickCube-v1", robots=hand, obs_mode="rgb")) as env:
        env.reset(seed=0)
        for cameras in (env.observer.cameras, {"hand": env.observer.cameras["hand_camera"]}):
            both = [pictures(env.simulation, layered=x, cameras=cameras) for x in (False, True)]
            for laid, whole in zip(*both, strict=True):
                np.testing.assert_array_equal(laid, whole)
            hidden = {body.entity.name for body in studio_of(env.simulation)._bodies._hidden}
            assert {"panda_link0", "panda_link1"} <= hidden
            assert not hidden & {"table-workspace", "cube", "panda_leftfinger"}


def test_what_stands_still_is_drawn_again_where_it_was_moved():
    simulation = built(RED, GREEN)
    before = pictures(simulation, layered=True)
    worlds_below(simulation)[0].set_pose("box0", [0.0, -0.2, 0.1, 1.0, 0.0, 0.0, 0.0])
    after = pictures(simulation, layered=True)
    assert not np.array_equal(before[0], after[0])
    expect_same(simulation)


def test_of_two_surfaces_in_one_place_the_order_decides(monkeypatch: pytest.MonkeyPatch):
    for kinds in (("static", "kinematic"), ("kinematic", "static")):
        simulation = built(RED, GREEN, kinds=kinds, apart=0.0)
        at_once = whole_pictures(monkeypatch)
        simulation.look(0, CAMERAS, ("rgb",), markers=False)
        assert at_once, "nothing noticed that both are equally far away"
        assert sum(at_once) < len(CAMERAS), "one of them looks away, and is drawn again"
        expect_same(simulation)


def test_what_is_see_through_is_drawn_with_what_is_behind_it(monkeypatch: pytest.MonkeyPatch):
    simulation = built(RED, GLASS)
    at_once = whole_pictures(monkeypatch)
    simulation.look(0, CAMERAS, ("rgb",), markers=False)
    assert at_once
    assert not studio_of(simulation)._bodies.solid


def test_pictures_of_many_worlds_are_drawn_side_by_side():
    with closing(tasks.make("PickCube-v1", 3, render_mode="rgb_array")) as env:
        env.reset(seed=0)
        front, simulation = {"front": CAMERAS["front"]}, env.simulation
        begun = [simulation.begin_look(i, front, ("rgb",), markers=False) for i in range(3)]
        for i, finish in reversed(list(enumerate(begun))):
            (own,) = finish()
            (alone,) = simulation.look(i, front, ("rgb",), markers=False)
            np.testing.assert_array_equal(own.images["rgb"], alone.images["rgb"])
