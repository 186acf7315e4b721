"""Arms that touch are seen where physics lets them pass through each other, too."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest

from layouts import face_to_face
from robot_layouts.experts.script import Scene
from robot_layouts.experts.touching import ArmWatch
from robots import MissingPackageError
from tasks import Randomization, get_task_class, make

HANDS = [0.0, 0.41, 0.0, -2.05, 0.0, 2.46, 0.785, 0.04, 0.04]  # in each other, 1.2 m apart


@pytest.mark.parametrize("task_id", ["TwoRobotPickCube-v1", "TwoRobotLiftBar-v1"])
def test_hands_in_each_other_are_seen_in_clones_as_in_other_tasks(task_id):
    cls = get_task_class(task_id)
    facing = face_to_face({"left": "panda", "right": "panda"}, spacing=1.2)
    task = cls(replace(cls.scenario, layout=facing, obs_mode="none", check_layout=False))
    for name in facing:
        task.simulation.worlds[0].stand(name, HANDS)
    watch = ArmWatch(task)
    task.step(np.zeros((1, 16), np.float32))
    by_physics = task.simulation.backend.arms_touching(0)
    assert any({part.name for part in pair} == {"panda_hand"} for pair in by_physics) == (
        cls.native_id is None
    )
    task.simulation.worlds[0].stand("left", HANDS)
    task.simulation.worlds[0].stand("right", HANDS)
    task.step(np.zeros((1, 16), np.float32))
    found = watch.touching()
    assert any({part.name for part in pair} == {"panda_hand"} for pair in found)
    task.close()


def test_a_scene_says_which_hand_touches_a_body():
    env = make("TwoRobotPickCube-v1", obs_mode="none")
    env.reset(seed=0)
    assert not Scene(env).touches("left", "cube")
    world, qpos = env.simulation.worlds[0], Scene(env).qpos("left")
    qpos[-2:] = 0.0195  # fingers that hold a cube of 4 cm
    world.stand("left", qpos.tolist())
    world.set_pose("cube", tuple(Scene(env).tcp("left")[0].tolist()))
    closing = np.zeros((1, 16), np.float32)
    closing[0, 7] = -1.0
    env.step(closing)
    scene = Scene(env)
    assert scene.touches("left", "cube")
    assert not scene.touches("right", "cube")
    env.close()


def test_without_what_measures_overlaps_a_strict_watch_is_refused(monkeypatch):
    cls = get_task_class("TwoRobotPickCube-v1")
    task = cls(replace(cls.scenario, obs_mode="none"))
    monkeypatch.setitem(sys.modules, "fcl", None)
    with pytest.raises(MissingPackageError, match=r"robot-layouts\[checks\]"):
        ArmWatch(task)
    with pytest.warns(RuntimeWarning, match="plans may be others"):
        assert ArmWatch(task, strict=False).touching() == []
    task.close()


def test_overlaps_are_measured_where_robots_stand_in_the_present_episode():
    cls = get_task_class("TwoRobotPickCube-v1")
    apart = Randomization(bases={"left": {"x": -0.3}})
    facing = face_to_face({"left": "panda", "right": "panda"}, spacing=1.2)
    task = cls(
        replace(
            cls.scenario, layout=facing, obs_mode="none", check_layout=False, randomization=apart
        )
    )
    task.reset(seed=0)
    for name in facing:
        task.simulation.worlds[0].stand(name, HANDS)
    watch = ArmWatch(task)
    assert watch.touching() == []
    task.close()
