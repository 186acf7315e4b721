"""Arms are driven to postures and rest there, however quick their drives are."""

import numpy as np
import pytest

import tasks
from layouts import face_to_face
from robot_layouts.experts.rehearsal import Rehearsal
from robot_layouts.experts.script import Waypoint
from tests.quick import quick_cases


@pytest.mark.parametrize("robot", quick_cases(["panda", "so101", "z1"], ["panda", "z1"]))
def test_an_arm_comes_to_rest_at_a_posture(robot: str):
    env = tasks.make("TwoRobotHandOver-v1", layout=face_to_face({"left": robot, "right": "panda"}))
    rehearsal = Rehearsal(env)
    scene = rehearsal.begin(0)
    own = env.layout["left"].robot
    columns = [own.joints.index(joint) for joint in own.arm_joints]
    goal = scene.qpos("left")[columns]
    goal[:3] += (0.2, -0.1, 0.1) if robot != "z1" else (0.2, -0.1, -0.1)
    rehearsal.play({"left": [Waypoint("there", joints=lambda _: [goal], near=0.01, most=60)]})
    assert np.abs(rehearsal.scene().qpos("left")[columns] - goal).max() < 0.01
