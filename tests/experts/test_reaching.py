"""Bringing tool centre points to places."""

import numpy as np

import tasks
from robot_layouts.experts.reaching import reaching
from robot_layouts.experts.script import Scene
from robot_layouts.experts.tips import pose_solver


def test_a_tip_without_fingers_stays_turned_about_itself_and_a_hand_turns_its_fingers_level():
    env = tasks.make("CellPressTogether-v1", obs_mode="none")
    env.reset(0)
    scene, turned = Scene(env), dict[str, float]()
    for arm in ("second", "third"):  # a stick and a hand, their last joint a quarter turn off
        go = reaching(env, arm, "go", lambda s, arm=arm: s.tcp(arm)[0], leans=(0,), as_it_is=False)
        qpos = scene.qpos(arm)
        qpos[6] += np.pi / 2 if qpos[6] < 0 else -np.pi / 2
        solutions = pose_solver(env, arm).solutions
        found = [arm_joints for pose in go.to(scene) for arm_joints in solutions(*pose, qpos)]
        turned[arm] = min(float(np.abs(joints - qpos[:7]).max()) for joints in found)
    assert turned["second"] < 0.3 < 1.0 < turned["third"]
