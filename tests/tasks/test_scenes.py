"""What robots stand in, where it is no table: the bare ground, a kitchen counter."""

from dataclasses import replace

import numpy as np
import pytest

import tasks
from layouts import Layout
from objects.shapes import Floor
from objects.solids import bounds
from robot_layouts.simulation import Plane, World
from robots import LayoutError, TaskError
from tasks import Cube, Ground, KitchenCounter
from tasks.randomization.distractors import area_of

PICK = tasks.get_task_class("PickCube-v1")


class OnGround(PICK):
    """Pick a cube up from the ground."""

    table = Ground()


def test_on_the_ground_there_is_a_floor_at_z_0_and_no_table():
    env = OnGround(OnGround.scenario)
    bodies = env.simulation.worlds[0].bodies
    assert list(bodies) == ["ground", "cube", "goal_site"]
    (plane,) = bodies["ground"].shapes
    assert isinstance(plane, Plane)
    assert plane.position == (0.0, 0.0, 0.0)
    assert bodies["ground"].kind == "static"
    for _ in range(20):
        env.step(env.action_space.sample() * 0)
    assert env.state.position("cube")[0, 2] == pytest.approx(0.02, abs=1e-3)


def test_robots_are_not_checked_against_a_table_that_is_not_there():
    low = Layout({"arm": replace(PICK.layout["arm"], position=(0.0, 0.0, -0.5))})
    OnGround(replace(OnGround.scenario, layout=low)).close()
    with pytest.raises(LayoutError, match="arm and table collide"):
        PICK(replace(PICK.scenario, layout=low))


def test_without_a_table_distractors_stand_around_what_people_look_at():
    x_min, y_min, x_max, y_max = area_of(None, (1.0, 2.0, 0.0))
    assert (x_min + x_max, y_min + y_max) == pytest.approx((2.0, 4.0))
    assert 0.0 < x_max - x_min == pytest.approx(y_max - y_min)
    varied = tasks.Randomization(distractors=tasks.Distractors(count=2))
    env = OnGround(replace(OnGround.scenario, randomization=varied))
    assert "distractor_1" in env.get_state_dict()["actors"]


def test_a_floor_is_drawn_with_as_many_sizes_of_its_texture_as_declared():
    world = World(OnGround.layout, visuals=True)
    Ground(mipmaps=7).add_to(world, "table")
    _, floor = world.bodies["ground"].shapes
    assert isinstance(floor, Floor)
    assert floor.mipmaps == 7


def test_a_kitchen_counter_is_as_large_as_declared():
    boxes = []
    for scale in (1.0, 0.5):
        world = World(OnGround.layout)
        KitchenCounter(scale).add_to(world, "table")
        assert list(world.bodies) == ["kitchen-counter", "ground"]
        boxes.append(np.ptp(bounds(world.bodies["kitchen-counter"].shapes), axis=0))
    width, length, height = boxes[0]
    assert (width, length) == pytest.approx((0.669, 3.108), abs=1e-3)
    assert height == pytest.approx(0.979, abs=1e-3)
    assert boxes[1] == pytest.approx(boxes[0] / 2)
    with pytest.raises(TaskError, match="KitchenCounter: scale is 0"):
        KitchenCounter(0)


@pytest.mark.parametrize("sizes", [0, 2.5, "all"])
def test_what_is_no_number_of_sizes_is_refused(sizes):
    with pytest.raises(TaskError, match="Ground: mipmaps is"):
        Ground(mipmaps=sizes)


def test_a_body_is_no_scene():
    with pytest.raises(TaskError, match=r"table is Cube\(.*a tasks.Surroundings is needed"):
        tasks.register_task("OnCube-v1")(type("OnCube", (OnGround,), {"table": Cube(0.02)}))
