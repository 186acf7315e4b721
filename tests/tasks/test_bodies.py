"""Bodies: what they are made of, and what none can be."""

import math

import numpy as np
import pytest

import tasks
from objects.shapes import Finish
from robot_layouts.simulation import Box, Friction, Sphere
from robots import SimulationError, TaskError
from tasks.language.bodies import Area, Ball, Compound, Cube, Cuboid, Peg


@pytest.mark.parametrize(
    ("declare", "message"),
    [
        (lambda: Cube(-1), "Cube: half_size is -1; it must be a number from 1e-06"),
        (lambda: Ball(0), "Ball: radius is 0; it must be a number from 1e-06"),
        (
            lambda: Cuboid((0.1, math.nan, 0.1)),
            r"Cuboid: half_size\[1\] is nan; it must be a number",
        ),
        (lambda: Cuboid((0.1, 0.1)), "Cuboid: half_size has 2 entries; it must be a tuple of 3"),
        (lambda: Peg(0.1, "thin"), "Peg: half_width is 'thin'; it must be a number from"),
        (
            lambda: Cube(0.1, (255, 0, 0, 1)),
            r"Cube: color\[0\] is 255; it must be a number from 0 to 1",
        ),
        (lambda: Cube(0.1, density=-1.0), "Cube: density is -1.0; it must be a number from 0.001"),
        (lambda: Cube(0.1, friction=0.3), "Cube: friction is 0.3; it must be a Friction or None"),
        (lambda: Cube(0.1, kind="still"), "Cube: kind is 'still'; it must be 'dynamic' or"),
        (lambda: Compound(()), "Compound: parts is empty"),
    ],
)
def test_what_no_body_can_be_is_refused_where_it_is_declared(declare, message):
    with pytest.raises(TaskError, match=f"^{message}"):
        declare()


@pytest.mark.parametrize(
    ("declare", "message"),
    [
        (lambda: Sphere(radius=math.inf), "Sphere: radius is inf; it must be a number"),
        (
            lambda: Box(half_size=(1, 1, 1), quaternion=(0, 0, 0, 0)),
            "Box: quaternion is .* rotation",
        ),
        (lambda: Finish(metallic=2), "Finish: metallic is 2; it must be a number from 0 to 1"),
    ],
)
def test_what_no_shape_can_be_is_refused_where_it_is_made(declare, message):
    with pytest.raises(SimulationError, match=f"^{message}"):
        declare()


def test_colour_and_matter_reach_the_shapes():
    rough, blue = Friction(static=2.0, dynamic=1.0), (0.0, 0.0, 1.0, 1.0)
    for body in (
        Cube(0.1, blue, density=500.0, friction=rough),
        Cuboid((0.1, 0.2, 0.3), blue, density=500.0, friction=rough),
        Ball(0.1, blue, density=500.0, friction=rough),
    ):
        (shape,) = body.shapes
        assert (shape.color, shape.density, shape.friction) == (blue, 500.0, rough)
    assert Cube(0.1).shapes == Cuboid([0.1, 0.1, 0.1]).shapes


def test_a_body_may_have_a_name_that_what_steps_the_task_uses_itself():
    class Named(tasks.get_task_class("PickCube-v1")):
        state, step, seeds = (Cube(0.02, spawn=Area(x=0.1, y=0.1)) for _ in range(3))

    env = Named(Named.scenario)
    assert {"state", "step", "seeds"} < set(env.bodies)
    assert env.step(np.zeros((1, 8)))[0].shape[0] == 1
    assert env.task.seeds is Named.bodies["seeds"]
