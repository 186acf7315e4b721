"""The model of sliding agrees with geometry and with physics, and plans made in it work in it."""

import numpy as np
import pytest

import tasks
from robot_layouts.experts.geometry import gripper_facing, yaw_of
from robot_layouts.experts.maniskill.push_plans import PushPlanner, Situation
from robot_layouts.experts.maniskill.push_t import BODY, contacts
from robot_layouts.experts.rehearsal import Rehearsal
from robot_layouts.experts.script import Scene, Waypoint

GOAL = np.array([-0.156, -0.1, 5 / 3 * np.pi])


@pytest.mark.parametrize(("seed", "where"), [(0, 10), (0, 70), (1, 100)])
def test_physics_agrees(seed, where):
    """4 cm straight on: the T comes to where the model says, within a third of its way."""
    rehearsal = Rehearsal(tasks.make("PushT-v1"))
    scene = rehearsal.begin(seed)
    position, quaternion = scene.body("Tee")
    pose = np.array([[*position[:2], yaw_of(quaternion)]])
    contact = contacts()[[where]]
    slides = list(BODY.push(pose, contact, np.zeros((1, 1)), np.full((1, 1), 0.04)))
    start = BODY.tips(pose, contact, 0.02)[0]
    track = [BODY.tips(slide.poses, slide.contacts)[0] for slide in slides]

    def at(place, height):
        return lambda scene: [(np.array([*place, height]), gripper_facing(0.0, 0.0))]

    up = scene.tcp("arm")[0][:2]
    script = (
        Waypoint("up", at(up, 0.06)),
        Waypoint("over", at(start, 0.06), near=0.01),
        Waypoint("down", at(start, 0.02), near=0.01),
        *(
            Waypoint(f"along {i}", at(place, 0.02), near=0.005, steps=2)
            for i, place in enumerate(track)
        ),
    )
    rehearsal.play({"arm": script})
    position, quaternion = Scene(rehearsal.task).body("Tee")
    now = np.array([*position[:2], yaw_of(quaternion)])
    error, way = now - slides[-1].poses[0], slides[-1].poses[0] - pose[0]
    size = np.array([1.0, 1.0, 0.09])
    assert np.linalg.norm(size * way) > 0.02
    assert np.linalg.norm(size * error) < np.linalg.norm(size * way) / 3


@pytest.mark.parametrize("seed", range(3))
def test_plans_work_in_the_model(seed):
    """Plan, push, look, and plan anew, as the expert does, but where the model is the truth."""
    random = np.random.default_rng(seed)
    planner = PushPlanner(BODY, contacts(), GOAL, np.array([-0.615, 0.0]), random)
    pose = GOAL + random.uniform(-1, 1, 3) * (0.1, 0.1, 1.5)
    tip = np.array([-0.32, 0.28])
    for _ in range(4):
        push = planner.next_push(Situation(pose, tip, None, 100))
        if push is None:
            break
        *_, last = BODY.push(
            pose[None], push.contact[None], push.directions[None], push.lengths[None]
        )
        pose, tip = last.poses[0], BODY.tips(last.poses, last.contacts)[0]
    assert planner.error(pose[None])[0] < 0.005


def test_a_body_at_its_goal_stays():
    random = np.random.default_rng(0)
    planner = PushPlanner(BODY, contacts(), GOAL, np.array([-0.615, 0.0]), random)
    turned = GOAL + (0.0, 0.0, 2 * np.pi)
    assert planner.error(turned[None])[0] == pytest.approx(0.0, abs=1e-9)
    assert planner.next_push(Situation(turned, np.array([-0.32, 0.28]), None, 100)) is None
