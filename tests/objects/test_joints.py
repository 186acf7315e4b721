"""Joints of things: what they refuse, and where the parts that they move are."""

from dataclasses import replace
from math import inf, pi

import numpy as np
import pytest

from objects import Joint, ObjectRegistry
from objects.inspect import report
from objects.shapes import Box
from objects.solids import part_poses
from robots import DescriptorError, UnknownNameError

ARM = Box((0.1, 0.01, 0.01), position=(0.1, 0.0, 0.0))
TURN = Joint(name="elbow", kind="turn", parts=(ARM,), axis=(0.0, 0.0, 1.0), upper=pi)
BEYOND = Joint(
    name="wrist",
    kind="turn",
    parts=(replace(ARM, position=(0.3, 0.0, 0.0)),),
    axis=(0.0, 0.0, 1.0),
    at=(0.2, 0.0, 0.0),
    upper=pi,
    carrier="elbow",
)
SLIDE = replace(TURN, name="rod", kind="slide", axis=(0.0, 0.6, 0.8), upper=0.5)
HERE = np.array([[1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"name": "an elbow"}, "joint name 'an elbow' must be a letter followed by"),
        ({"kind": "twist"}, "Joint: kind is 'twist'; it must be 'slide' or 'turn'"),
        ({"axis": (0.0, 0.0, 2.0)}, r"joint elbow: axis \(0.0, 0.0, 2.0\) must be of length 1"),
        ({"lower": 4.0}, "joint elbow: lower is 4, upper 3.14159; the lower one must be the small"),
        ({"upper": None}, "joint elbow: one of lower and upper is None; a part that turns without"),
        ({"kind": "slide", "lower": None, "upper": None}, "joint elbow: a part that slides must"),
        (
            {"axes": (1.0, 0.0, 0.0, 0.0)},
            r"joint elbow: axes turns x to \(1.0, 0.0, 0.0\); it mu",
        ),
        ({"axes": (2.0, 0.0, 0.0, 0.0)}, "joint elbow: axes is .*, which has length 2"),
        ({"start": 4.0}, "joint elbow is 4.0; it must be a number from 0 to 3.14159 rad"),
        ({"parts": (replace(ARM, collides=False),)}, "joint elbow: no part collides"),
        ({"friction": -1.0}, "Joint: friction is -1.0; it must be a number from 0 to"),
    ],
)
def test_what_no_joint_can_be_is_refused(fields, message):
    with pytest.raises(DescriptorError, match=f"^{message}"):
        replace(TURN, **fields)


def test_joints_of_a_thing_have_names_of_their_own_and_something_that_carries_them():
    drawer = ObjectRegistry.load("drawer")
    with pytest.raises(DescriptorError, match="^drawer: two joints are called 'elbow'"):
        replace(drawer, joints=(TURN, TURN))
    with pytest.raises(UnknownNameError, match="unknown joint of drawer before 'wrist' 'elbow'"):
        replace(drawer, joints=(BEYOND, TURN))
    assert drawer.joint("drawer").kind == "slide"
    with pytest.raises(UnknownNameError, match="Did you mean 'drawer'"):
        drawer.joint("drawr")


def test_parts_are_where_their_joints_say():
    angles = np.array([[pi / 2, pi / 2]])
    found = part_poses((TURN, BEYOND), HERE, angles)
    half = np.sqrt(0.5)
    assert found["elbow"] == pytest.approx(np.array([[1, 2, 3, half, 0, 0, half]]))
    # The wrist is 0.2 m along what is the y axis now, and what it carries points along -x.
    assert found["wrist"] == pytest.approx(np.array([[1.2, 2.2, 3, 0, 0, 0, 1]]), abs=1e-12)
    assert part_poses((SLIDE,), HERE, np.array([[0.5]]))["rod"][0, :3] == pytest.approx(
        [1.0, 2.3, 3.4]
    )


def test_a_part_may_turn_without_end():
    wheel = replace(TURN, lower=None, upper=None)
    assert wheel.is_endless
    assert wheel.limits == (-inf, inf)
    assert wheel.check(-500.0) == -500.0
    assert wheel.scaled(2.0).limits == (-inf, inf)
    assert not TURN.is_endless
    assert TURN.limits == (0.0, pi)
    with pytest.raises(DescriptorError, match="joint elbow is inf; it must be a number from -1e"):
        wheel.check(inf)
    drawer = replace(ObjectRegistry.load("drawer"), joints=(wheel,))
    assert "elbow  turns  without end" in report(drawer)


def test_a_part_may_have_a_frame_of_its_own():
    wrist = replace(BEYOND, origin=(0.2, 0.0, 0.05))
    assert BEYOND.own_parts == BEYOND.parts
    assert wrist.own_parts[0].position == pytest.approx((0.1, 0.0, -0.05))
    assert wrist.scaled(2.0).origin == (0.4, 0.0, 0.1)
    beyond = replace(
        wrist, name="hand", carrier="wrist", origin=(0.3, 0.0, 0.0), at=(0.3, 0.0, 0.0)
    )
    plain = [replace(joint, origin=(0.0, 0.0, 0.0)) for joint in (TURN, wrist, beyond)]
    angles = np.array([[pi / 2, pi / 3, pi / 4]])
    found = part_poses((TURN, wrist, beyond), HERE, angles)
    for name, pose in part_poses(plain, HERE, angles).items():
        assert found[name][:, 3:] == pytest.approx(pose[:, 3:])
    assert found["elbow"] == pytest.approx(part_poses(plain, HERE, angles)["elbow"])
    assert found["wrist"][0, :3] == pytest.approx([1.0, 2.2, 3.05])
    assert found["hand"][0, :3] == pytest.approx([1 - 0.1 * np.sin(pi / 3), 2.25, 3.0])


def test_a_larger_thing_slides_farther_and_turns_as_far():
    thing = replace(ObjectRegistry.load("chest"), joints=(TURN, SLIDE)).scaled(2.0)
    turn, slide = thing.joints
    assert (turn.upper, slide.upper) == (pi, 1.0)
    assert slide.parts[0].half_size == (0.2, 0.02, 0.02)


def test_a_thing_with_joints_weighs_and_measures_with_its_parts():
    drawer = ObjectRegistry.load("drawer")
    case = replace(drawer, joints=())
    assert drawer.mass > case.mass + 0.3
    assert drawer.extent[0] > case.extent[0] + 0.04
    assert repr(drawer) == "ObjectDescriptor('drawer': 5 parts, 1 joints, 30 grasps)"
