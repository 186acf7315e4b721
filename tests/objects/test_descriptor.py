"""Descriptors of things: what they refuse, and what they say of themselves."""

import math
import pickle
from dataclasses import FrozenInstanceError, replace

import pytest

from objects import Grasp, NamedPoint, ObjectDescriptor, ObjectRegistry
from objects.shapes import Box, Cylinder, Plane
from robots import DescriptorError, UnknownNameError

CUBE = Box((0.02, 0.02, 0.02), position=(0.0, 0.0, 0.02))
QUARTER = math.sqrt(0.5)
ON_SIDE = (QUARTER, QUARTER, 0.0, 0.0)


def thing(**fields) -> ObjectDescriptor:
    return ObjectDescriptor(
        **{"name": "cube", "about": "A cube", "parts": (CUBE,), "source": "test", **fields}
    )


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"name": "2 cubes"}, "object name '2 cubes' must be a letter followed by letters"),
        ({"parts": ()}, "cube: no part collides; one at least must"),
        ({"parts": (replace(CUBE, collides=False),)}, "cube: no part collides"),
        ({"parts": (CUBE, Plane())}, "cube: parts holds a Plane, which has no size; parts are Box"),
        ({"parts": (1,)}, r"cube: parts\[0\] is 1; it must be a Shape"),
        ({"rests": {}}, "cube: rests is empty"),
        ({"rests": {"flat": (1, 1, 0, 0)}}, r"cube: rests\['flat'\] is .*, which has length 1.41"),
        ({"grasps": ("left",)}, r"cube: grasps\[0\] is 'left'; it must be a Grasp"),
        ({"points": {"top": (0, 0, 1)}}, r"cube: points\['top'\] is .*; it must be a NamedPoint"),
        ({"sizes": {"side": -1}}, r"cube: sizes\['side'\] is -1; it must be a number from 1e-06"),
    ],
)
def test_what_no_thing_can_be_is_refused(fields, message):
    with pytest.raises(DescriptorError, match=f"^{message}"):
        thing(**fields)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Grasp((0, 0, 0), (1, 0, 0, 0), 0.0), "Grasp: opening is 0.0; it must be a number"),
        (lambda: Grasp((0, 0, 0), (2, 0, 0, 0), 0.1), "Grasp: quaternion is .* length 2"),
        (lambda: Grasp((0, 0), (1, 0, 0, 0), 0.1), "Grasp: position has 2 entries"),
        (lambda: NamedPoint((0, math.inf, 0)), r"NamedPoint: position\[1\] is inf"),
        (lambda: NamedPoint((0, 0, 0), (0, 0, 0, 0)), "NamedPoint: quaternion is .* length 0"),
    ],
)
def test_what_no_grasp_or_point_can_be_is_refused(make, message):
    with pytest.raises(DescriptorError, match=f"^{message}"):
        make()


def test_a_descriptor_is_frozen_hashes_and_pickles():
    mug = ObjectRegistry.load("mug")
    with pytest.raises(FrozenInstanceError):
        mug.name = "cup"  # type: ignore[misc]
    with pytest.raises(TypeError, match="a descriptor is frozen"):
        mug.points["rim"] = mug.points["bottom"]  # type: ignore[index]
    again = pickle.loads(pickle.dumps(mug))
    assert again == mug
    assert hash(again) == hash(mug)


def test_mass_centre_and_extent_are_those_of_the_parts_that_collide():
    heavy = Cylinder(0.01, 0.05, position=(0.1, 0.0, 0.0), density=2000.0)
    seen = Box((1.0, 1.0, 1.0), collides=False)
    both = thing(parts=(CUBE, heavy, seen))
    cube, rod = 0.04**3 * 1000, math.pi * 0.01**2 * 0.1 * 2000
    assert both.mass == pytest.approx(cube + rod)
    assert both.centre_of_mass[0] == pytest.approx(0.1 * rod / (cube + rod))
    assert both.extent == pytest.approx((0.17, 0.04, 0.05))


def test_a_thing_rests_on_its_lowest_point():
    tall = thing(
        parts=(Box((0.01, 0.02, 0.03), position=(0.0, 0.0, 0.1)),),
        rests={"upright": (1.0, 0.0, 0.0, 0.0), "on_side": ON_SIDE},
    )
    assert tall.height() == tall.height("upright") == pytest.approx(-0.07)
    assert tall.height("on_side") == pytest.approx(0.02)
    with pytest.raises(UnknownNameError, match="unknown rest of cube 'onside'. Did you mean 'on_s"):
        tall.rest("onside")
    with pytest.raises(UnknownNameError, match="unknown point of cube 'rim'"):
        tall.point("rim")


def test_a_scaled_thing_is_larger_in_every_length_and_of_the_same_density():
    mug = ObjectRegistry.load("mug")
    large = mug.scaled(2.0)
    assert large.mass == pytest.approx(8 * mug.mass)
    assert large.extent == pytest.approx(tuple(2 * length for length in mug.extent))
    assert large.point("rim").position[2] == 2 * mug.point("rim").position[2]
    assert large.grasps[0].opening == 2 * mug.grasps[0].opening
    assert large.sizes == {name: 2 * size for name, size in mug.sizes.items()}
    with pytest.raises(DescriptorError, match="mug: scale is 0; it must be a number from 0.01"):
        mug.scaled(0)


def test_grasps_for_a_hand_leave_it_room():
    grasps = tuple(Grasp((0, 0, 0), (1, 0, 0, 0), wide) for wide in (0.01, 0.034, 0.035, 0.09))
    cube = thing(grasps=grasps)
    assert cube.grasps_for(0.04) == grasps[:2]
    assert cube.grasps_for(0.04, clearance=0.0) == grasps[:3]
