"""Descriptors refuse what contradicts itself, in words that say what would be right."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from robots import (
    ActionSplit,
    CameraMount,
    DescriptorError,
    Fingers,
    GripperMaterial,
    Home,
    JointGroup,
    NativeAgent,
    RobotRegistry,
    UnknownNameError,
)

PANDA = RobotRegistry.load("panda")
ARM = PANDA.action_split.groups["arm"]


def group(**changes) -> JointGroup:
    settings = {"lower": -1.0, "upper": 1.0, "stiffness": 1e3, "damping": 1e2, "force_limit": 100.0}
    return JointGroup(**{"joints": ("a", "b"), **settings, **changes})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"joints": ()}, "a joint group needs at least one joint"),
        ({"joints": ("a", "a")}, "names a joint twice: ('a', 'a')"),
        ({"unit": "deg"}, "unit is 'deg'; it must be 'rad' or 'm'"),
        ({"stiffness": -1.0}, "stiffness is -1.0; it must not be negative"),
        ({"damping": math.nan}, "JointGroup: damping is nan; it must be a finite number"),
        ({"stiffness": (1.0,)}, "stiffness has 1 numbers; the group has joints ('a', 'b')"),
        ({"multipliers": (1.0, -1.0)}, "only a mimic group has multipliers; ('a', 'b') is not one"),
        ({"mimic": True, "offsets": (0.0,)}, "offsets has 1 numbers; the group has joints"),
        (
            {"leaders": ("a",), "lead": 0.1},
            "only a mimic group that is driven to places has leaders; ('a', 'b') is not one",
        ),
        (
            {"mimic": True, "leaders": ("b2",), "lead": 0.1},
            "unknown leader of a joint group 'b2'. Did you mean 'b'?",
        ),
        (
            {"mimic": True, "leaders": ("a",)},
            "the leaders of ('a', 'b') are ('a',) and lead is 0.0; a linkage needs",
        ),
        ({"lower": (-1.0,)}, "lower has 1 numbers; the group ('a', 'b') takes 2"),
        ({"upper": (1.0, 2.0), "mimic": True}, "upper has 2 numbers; the group ('a', 'b') takes 1"),
        ({"upper": -1.0}, "range [-1.0, -1.0] of ('a', 'b') is not increasing"),
    ],
)
def test_a_joint_group_refuses_nonsense(changes, message):
    with pytest.raises(DescriptorError) as error:
        group(**changes)
    assert message in str(error.value)


def test_a_held_group_takes_no_number():
    held = JointGroup.hold(("lift", "turn"), stiffness=1e5, damping=1e3, force_limit=1e4)
    assert (held.size, held.ranges, held.bounds) == (0, (), ())
    split = ActionSplit(base=held, arm=group())
    assert dict(split) == {"base": slice(0, 0), "arm": slice(0, 2)}
    with pytest.raises(DescriptorError, match="needs at least one joint group to drive"):
        ActionSplit(base=held)


def test_drives_are_one_for_all_joints_or_one_each():
    drives = group(stiffness=(1.0, 2.0)).drives
    assert drives == ((1.0, 1e2, 100.0), (2.0, 1e2, 100.0))


def test_a_mimic_group_takes_one_number():
    assert group(mimic=True).size == 1
    assert group(mimic=True).ranges == ((-1.0, 1.0),)
    assert group(upper=(1.0, 2.0)).ranges == ((-1.0, 1.0), (-1.0, 2.0))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"name": "7dof"}, "robot name '7dof' must be a letter followed by letters, digits and _"),
        ({"reach": 0.0}, "panda: reach is 0.0 m; it must be positive"),
        ({"keyframes": {"rest": (0.0,)}}, "keyframe 'rest' has 1 numbers; the robot has 9 joints"),
        (
            {"keyframes": {"rest": (math.nan,) * 9}},
            "panda: keyframes['rest'][0] is nan; it must",
        ),
    ],
)
def test_a_descriptor_refuses_nonsense(changes, message):
    with pytest.raises(DescriptorError) as error:
        replace(PANDA, **changes)
    assert message in str(error.value)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: group(joints="ab"), "JointGroup: joints is 'ab'; it must be a tuple, each a text"),
        (lambda: group(delta=1), "JointGroup: delta is 1; it must be True or False"),
        (lambda: group(limits=((0, 1, 2), (0, 1))), "limits[0] has 3 entries; it must be a tuple"),
        (lambda: ActionSplit(arm=None), "ActionSplit['arm'] is None; it must be a JointGroup"),
        (lambda: GripperMaterial(("a",), -1.0, 1.0), "static_friction is -1.0; it must not be"),
        (lambda: GripperMaterial(("a",), 1.0, 1.0, 2.0), "restitution is 2.0; it must be between"),
        (lambda: NativeAgent(tip_links=("a", "a")), "NativeAgent: tip_links has a more than once"),
        (lambda: Fingers(("a",)), "Fingers: links has 1 entries; it must be a tuple of 2"),
        (lambda: Fingers(("a", "b"), (0, 1)), "opening_signs is (0, 1); each must be 1 or -1"),
        (
            lambda: Fingers(("a", "b"), opening_axes=((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))),
            "opening_axes is ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)); each must have a length",
        ),
        (lambda: CameraMount("eye", "hand", width=0), "camera 'eye': width is 0 pixels"),
        (lambda: CameraMount("eye", "hand", fov=4.0), "camera 'eye': fov is 4.0 rad; it must be"),
        (lambda: CameraMount("eye", "hand", near=200.0), "it must be 0 < near < far"),
        (
            lambda: Home(quaternion=(0, 0, 0, 0)),
            "Home: quaternion is (0, 0, 0, 0), which has length 0",
        ),
        (lambda: replace(PANDA, name=5), "RobotDescriptor: name is 5; it must be a text"),
        (
            lambda: replace(PANDA, allowed_collisions=(("a", "b"), ("c", "c"))),
            "panda: allowed_collisions[1] has c more than once",
        ),
        (
            lambda: replace(PANDA, cameras=(CameraMount("eye", "a"), CameraMount("eye", "b"))),
            "panda: cameras has eye more than once",
        ),
    ],
)
def test_what_is_declared_wrongly_is_said_in_words(make, message):
    with pytest.raises(DescriptorError) as error:
        make()
    assert message in str(error.value)


def test_lists_and_numbers_of_numpy_are_taken_as_what_they_mean():
    same = replace(
        PANDA,
        reach=np.float64(PANDA.reach),
        keyframes={key: np.array(qpos) for key, qpos in PANDA.keyframes.items()},
        gripper_material=replace(PANDA.gripper_material, links=list(PANDA.gripper_material.links)),
    )
    assert same == PANDA
    assert hash(same) == hash(PANDA)


def test_a_home_at_an_unknown_keyframe_is_refused():
    with pytest.raises(UnknownNameError, match="keyframe of panda 'resst'. Did you mean 'rest'"):
        replace(PANDA, home=replace(PANDA.home, keyframe="resst"))


def test_an_action_split_refuses_nonsense():
    with pytest.raises(DescriptorError, match="needs at least one joint group to drive"):
        ActionSplit()
    with pytest.raises(DescriptorError, match=r"joints \['a', 'b'\] are in more than one group"):
        ActionSplit(arm=group(), hand=group())
    with pytest.raises(UnknownNameError, match="joint group 'grip'. Did you mean 'gripper'"):
        PANDA.action_split["grip"]


def test_descriptors_splits_and_keyframes_are_frozen():
    with pytest.raises(FrozenInstanceError):
        PANDA.reach = 1.0
    with pytest.raises(AttributeError, match="ActionSplit is frozen"):
        PANDA.action_split.size = 3
    changes = (
        lambda frames: frames.update(rest=()),
        lambda frames: frames.pop("rest"),
        lambda frames: frames.clear(),
        lambda frames: frames.setdefault("new", ()),
        lambda frames: frames.popitem(),
        lambda frames: frames.__setitem__("rest", ()),
        lambda frames: frames.__delitem__("rest"),
        lambda frames: frames.__ior__({"rest": ()}),
    )
    for change in changes:
        with pytest.raises(TypeError, match="a descriptor is frozen"):
            change(PANDA.keyframes)
    assert len(PANDA.keyframe("rest")) == 9


def test_action_numbers_are_described_with_name_unit_and_range():
    numbers = PANDA.describe_action()
    assert [number.name for number in numbers] == [
        *(f"arm.panda_joint{i}" for i in range(1, 8)),
        "gripper",
    ]
    first, last = numbers[0], numbers[-1]
    assert (first.unit, first.lower, first.upper, first.relative) == (
        "rad per step",
        -0.1,
        0.1,
        True,
    )
    assert (last.unit, last.lower, last.upper, last.relative) == ("m", -0.01, 0.04, False)
    assert last.joints == ("panda_finger_joint1", "panda_finger_joint2")
    assert str(last).split() == ["7", "gripper", "-0.01", "…", "0.04", "m"]


def test_a_variant_is_a_replacement():
    stiff = replace(PANDA, action_split=PANDA.action_split.replace(arm=replace(ARM, stiffness=2e3)))
    assert stiff != PANDA
    assert stiff.action_split.groups["arm"].stiffness == 2e3
    assert stiff.action_split["gripper"] == PANDA.action_split["gripper"]
