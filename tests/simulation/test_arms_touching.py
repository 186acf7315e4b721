"""Which arms touch each other is seen in every step of physics."""

from __future__ import annotations

import numpy as np
import pytest

from layouts import Layout, Placement, face_to_face, single
from robot_layouts.simulation import Simulation
from robot_layouts.simulation.checks.overlaps import empty, stand
from robots import RobotRegistry, SimulationError

DUAL = RobotRegistry.load("mobile_panda_dual")
CELL = single({"cell": "mobile_panda_dual"})


def step(simulation: Simulation, postures: dict[str, list[float]] | None = None) -> None:
    stand(simulation)
    for name, qpos in (postures or {}).items():
        simulation.worlds[0].stand(name, qpos)
    still = np.zeros((1, simulation.layout.action_dim), np.float32)
    simulation.step(still, simulation.read().joint_positions)


def test_robots_that_touch_are_named_once_until_it_is_asked():
    place = Placement("panda", position=(0.0, 0.0, 0.0))
    far = Placement("panda", position=(2.0, 0.0, 0.0))
    near = Placement("panda", position=(0.05, 0.0, 0.0))
    for other, expected in ((near, {"left", "right"}), (far, set())):
        simulation = Simulation(Layout({"left": place, "right": other}), empty, 1)
        simulation.backend.watch_arms()
        step(simulation)
        touching = simulation.backend.arms_touching(0)
        assert {part.robot for pair in touching for part in pair} == expected
        assert len(set(touching)) == len(touching)
        assert simulation.backend.arms_touching(0) == []


def test_a_world_that_is_built_anew_is_looked_at_too():
    simulation = Simulation(face_to_face({"a": "panda", "b": "panda"}, spacing=0.05), empty, 1)
    simulation.backend.watch_arms()
    simulation.rebuild([0], empty)
    step(simulation)
    assert simulation.backend.arms_touching(0)


def test_limbs_of_one_robot_are_arms():
    """The right hand's finger is in the left arm's first link; a finger in its own hand is not."""
    posture = dict(zip(DUAL.joints, DUAL.keyframe("rest"), strict=True))
    for side, turns in (("left", (0.4, 1.0, -1.2)), ("right", (1.7, 1.1, -2.5))):
        posture |= {f"{side}_panda_joint{i}": x for i, x in zip((1, 2, 4), turns, strict=True)}
    simulation = Simulation(CELL, empty, 1)
    simulation.backend.watch_arms()
    step(simulation, {"cell": list(posture.values())})
    names = [{part.name for part in pair} for pair in simulation.backend.arms_touching(0)]
    assert names == [{"right_panda_leftfinger", "left_panda_link1"}]


def test_it_must_be_looked_at_before():
    with pytest.raises(SimulationError, match=r"call watch_arms\(\) first"):
        Simulation(single({"arm": "panda"}), empty, 1).backend.arms_touching(0)


@pytest.mark.parametrize("links_pass", [False, True])
def test_hands_of_two_robots_collide_unless_they_are_to_pass_as_in_maniskill(links_pass):
    """Both hands are in each other, as are other links that never pass."""
    facing = face_to_face({"left": "panda", "right": "panda"}, spacing=1.2)
    simulation = Simulation(facing, empty, 1, links_pass=links_pass)
    simulation.backend.watch_arms()
    posture = [0.0, 0.41, 0.0, -2.05, 0.0, 2.46, 0.785, 0.04, 0.04]
    step(simulation, dict.fromkeys(facing, posture))
    touching = [{part.name for part in pair} for pair in simulation.backend.arms_touching(0)]
    assert {"panda_link6", "panda_link7"} in touching
    assert ({"panda_hand"} in touching) != links_pass
