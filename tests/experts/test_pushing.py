"""The model of sliding agrees with geometry and with physics, and plans made in it work in it."""

import numpy as np
import pytest

import tasks
from robot_layouts.experts.geometry import gripper_facing, yaw_of
from robot_layouts.experts.maniskill.push_plans import PushPlanner, Situation
from robot_layouts.experts.maniskill.push_t import BODY, contacts, touches
from robot_layouts.experts.maniskill.sliding import SlidingBody, to_body, to_world
from robot_layouts.experts.rehearsal import Rehearsal
from robot_layouts.experts.script import Scene, Waypoint

DISC = SlidingBody(centre=(0.0, 0.0), torque_arm=0.05, tip_radius=0.01)
FROM_LEFT = np.array([[-0.1, 0.0, -1.0, 0.0]])  # pushes along x
GOAL = np.array([-0.156, -0.1, 5 / 3 * np.pi])


def pushed(body: SlidingBody, contact, direction, length, pose=(0.0, 0.0, 0.0)):
    """Return the last slide of one stroke, and the tip's way."""
    poses = np.array([pose])
    slides = list(body.push(poses, contact, np.array([[direction]]), np.array([[length]])))
    tip = body.tips(slides[-1].poses, slides[-1].contacts) - body.tips(poses, contact)
    return slides[-1], tip[0]


@pytest.mark.parametrize("yaw", [0.0, 1.0, -2.0])
def test_a_push_through_the_centre_does_not_turn(yaw):
    slide, tip = pushed(DISC, FROM_LEFT, 0.0, 0.07, pose=(0.3, 0.2, yaw))
    ahead = 0.07 * np.array([np.cos(yaw), np.sin(yaw)])
    np.testing.assert_allclose(slide.poses[0], [0.3 + ahead[0], 0.2 + ahead[1], yaw], atol=1e-12)
    np.testing.assert_allclose(tip, ahead, atol=1e-12)
    assert slide.squareness[0] == pytest.approx(1.0)


@pytest.mark.parametrize("side", [-1, 1])
def test_a_push_beside_the_centre_turns_the_body(side):
    contact = FROM_LEFT + [0.0, 0.04 * side, 0.0, 0.0]
    slide, _ = pushed(DISC, contact, 0.0, 0.01)
    assert np.sign(slide.poses[0, 2]) == -side
    assert 0 < slide.poses[0, 0] < 0.01


@pytest.mark.parametrize("direction", [-0.6, 0.0, 0.6])
def test_the_tip_goes_as_far_as_it_is_told(direction):
    """Short enough for a straight way; its own direction is from the inward normal."""
    contact = FROM_LEFT + [0.0, 0.03, 0.0, 0.0]
    _, tip = pushed(DISC, contact, direction, 1e-4)
    way = 1e-4 * np.array([np.cos(direction), np.sin(direction)])
    np.testing.assert_allclose(tip, way, atol=1e-6)


def test_an_oblique_push_is_not_square():
    """The force is steeper than the way: sideways the disc gives way by turning."""
    slide, _ = pushed(DISC, FROM_LEFT, 1.2, 1e-4)
    share = 0.05**2 / (0.05**2 + 0.1**2)
    assert slide.squareness[0] == pytest.approx(np.cos(np.arctan(share * np.tan(1.2))), abs=1e-3)


def test_frames_are_changed_there_and_back():
    poses = np.tile([0.3, -0.2, 2.1], (5, 1))
    points = np.random.default_rng(0).normal(size=(5, 2))
    np.testing.assert_allclose(to_body(poses[0], to_world(poses, points)), points, atol=1e-12)


def test_contacts_lie_around_the_t():
    rows = contacts()
    assert len(rows) > 100
    np.testing.assert_allclose(np.linalg.norm(rows[:, 2:], axis=1), 1.0)
    assert touches(rows[:, :2]).all()
    assert touches(rows[:, :2] + 0.008 * rows[:, 2:]).all()
    assert not touches(rows[:, :2] + 0.0121 * rows[:, 2:]).any()


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
