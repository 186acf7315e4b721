"""Settings of physics are checked where they are declared."""

import dataclasses
import math

import numpy as np
import pytest

import tasks
from layouts import single
from robot_layouts.simulation import SAPIEN_DEFAULTS, Friction, PhysicsSettings, Simulation
from robot_layouts.simulation.physics import substeps
from robots import SimulationError


@pytest.mark.parametrize("field", [field.name for field in dataclasses.fields(PhysicsSettings)])
def test_no_field_takes_nonsense(field):
    for value in (None, "1", math.nan, -7, 1e9, ()):
        with pytest.raises(SimulationError, match=field):
            PhysicsSettings(**{field: value})


@pytest.mark.parametrize("field", ["static", "dynamic", "restitution"])
def test_no_coefficient_takes_nonsense(field):
    for value in (None, "0.3", math.inf, -0.1, 1e9, True):
        with pytest.raises(SimulationError, match=f"friction: {field} is "):
            Friction(**{field: value})


def test_contacts_are_generated_before_bodies_rest():
    with pytest.raises(SimulationError, match="contact_offset > rest_offset"):
        PhysicsSettings(contact_offset=0.01, rest_offset=0.01)


@pytest.mark.parametrize(
    ("frequency", "steps"),
    [(100, 1), (50.0, 2), (100 / 3, 3), (33.333333, 3), (20, 5), (0.01, 10_000)],
)
def test_a_control_step_is_a_whole_number_of_physics_steps(frequency, steps):
    assert substeps(PhysicsSettings(), frequency) == steps
    assert substeps(SAPIEN_DEFAULTS, np.float64(frequency)) == steps


@pytest.mark.parametrize("timestep", [1 / n for n in (49, 60, 90, 120, 240, 300, 500, 1000)])
def test_every_multiple_of_a_timestep_that_has_no_exact_digits(timestep):
    for steps in (1, 2, 3, 7, 10_000):
        settings = PhysicsSettings(timestep=timestep)
        assert substeps(settings, 1 / (timestep * steps)) == steps
        assert substeps(settings, round(1 / timestep) / steps) == steps


@pytest.mark.parametrize(
    ("frequency", "message"),
    [
        (30, "the nearest are 33.333333 and 25 Hz"),
        (19, "the nearest are 20 and 16.666667 Hz"),
        (150, "from 0.01 to 100 Hz, with 1 to 10000 physics steps of 0.01 s"),
        *((wrong, "from 0.01 to 100 Hz") for wrong in (500, 1e9, 0, -20, math.nan, math.inf, "20")),
    ],
)
def test_other_frequencies_are_refused(frequency, message):
    with pytest.raises(SimulationError, match=f"control_frequency is .*{message}"):
        tasks.make("PickCube-v1", control_frequency=frequency)
    with pytest.raises(SimulationError, match=message):
        Simulation(single({"arm": "panda"}), lambda world, _: None, 1, control_frequency=frequency)
