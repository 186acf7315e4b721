"""Families: every one of them, their members by seed, and what fits together."""

import functools
import os
import subprocess
import sys
from hashlib import sha256

import numpy as np
import pytest

from objects import Made, ObjectDescriptor, ObjectRegistry, Size, family
from objects.registry import CATALOGUE, OBJECTS
from objects.shapes import Box
from objects.solids import surface
from robot_layouts.kinematics.rotations import rotation_of
from robots import DescriptorError, UnknownNameError
from tests.checkout import ROOT

SEEDS = range(5)
FEWEST_GRASPS = 20


def digests() -> list[str]:
    """Return what identifies the first members of each family."""
    found: list[str] = []
    for name in CATALOGUE:
        for d in members(name)[:4]:
            text = repr((d.name, d.parts, d.rests, d.points, d.grasps, d.joints, d.sizes, d.seed))
            found.append(f"{name} {d.seed} {sha256(text.encode()).hexdigest()}")
    return found


@functools.cache
def members(name: str) -> list[ObjectDescriptor]:
    return [ObjectRegistry.load(name, seed) for seed in (None, *SEEDS)]


def test_there_are_twenty_families_at_least_and_each_is_called_as_its_function():
    assert len(CATALOGUE) >= 20
    assert list(CATALOGUE) == sorted(CATALOGUE)
    for name in CATALOGUE:
        found = ObjectRegistry.family(name)
        assert found.name == name
        assert found.about


@pytest.mark.parametrize("name", CATALOGUE)
def test_members_are_sound(name):
    for member in members(name):
        assert 0.005 < member.mass < 5.0
        assert all(0.01 < length < 0.8 for length in member.extent)
        assert len(member.grasps) >= FEWEST_GRASPS or (member.joints and not member.grasps)
        assert len(set(member.grasps)) == len(member.grasps)
        assert member.points
        assert all(np.isfinite(member.height(rest)) for rest in member.rests)


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_seed_gives_one_member_between_the_bounds_and_another_seed_another(name):
    found = ObjectRegistry.family(name)
    assert found.member(3) == found.member(3)
    assert found.member(3) != found.member(4)
    assert found.usual == found() == ObjectRegistry.load(name)
    usual, *drawn = members(name)
    for member in (usual, drawn[0]):
        assert found(**member.sizes).parts == member.parts
    for member in (usual, *drawn):
        for length, (_, low, high) in found.sizes.items():
            assert low <= member.sizes[length] <= high


def test_another_process_makes_the_same_bytes():
    code = "from tests.objects.test_families import digests; print(*digests(), sep='\\n')"
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONHASHSEED": "1", "PYTHONPATH": str(ROOT)},  # here it is random
        capture_output=True,
        text=True,
        check=True,
    )
    here = digests()
    assert done.stdout.splitlines() == here
    assert len({*here}) == 4 * len(CATALOGUE)


@pytest.mark.parametrize("name", CATALOGUE)
def test_fingers_close_on_the_surface_where_a_grasp_says(name):
    """Along the way in which the fingers close, what is held is as wide as the opening."""
    for member in members(name)[:2]:
        surfaces = [surface(part) for part in member.all_parts]
        for grasp in member.grasps:
            frame = rotation_of(np.array(grasp.quaternion))
            assert np.allclose(frame.T @ frame, np.eye(3), atol=1e-6)
            spans = [span for s in surfaces if (span := _span(s, grasp.position, frame))]
            half = grasp.opening / 2
            held = [span for span in spans if span[0] < half and span[1] > -half]
            low, high = min(s[0] for s in held), max(s[1] for s in held)
            assert high - low == pytest.approx(grasp.opening, abs=1.5e-3), grasp
            assert high == pytest.approx(-low, abs=1.5e-3), grasp


def _span(surface, position, frame):
    """Where the line along which fingers close goes through a convex surface: from, to (m)."""
    one, *_ = surface.corners[surface.triangles].transpose(1, 0, 2)
    normals = surface.normals
    ahead = normals @ frame[:, 1]
    away = np.einsum("ij,ij->i", normals, one - np.array(position))
    with np.errstate(divide="ignore", invalid="ignore"):
        at = away / ahead
    low = max(at[ahead < -1e-12], default=-np.inf)
    high = min(at[ahead > 1e-12], default=np.inf)
    outside = (away[np.abs(ahead) <= 1e-12] < -1e-12).any()
    return None if outside or low >= high else (low, high)


def test_a_length_that_the_family_does_not_have_is_named_with_the_closest():
    mug = ObjectRegistry.family("mug")
    with pytest.raises(UnknownNameError, match="unknown length of mug 'radios'. Did you mean 'rad"):
        mug(radios=0.04)
    with pytest.raises(DescriptorError, match="mug: radius is 0.2; it must be a number from 0.034"):
        mug(radius=0.2)
    with pytest.raises(DescriptorError, match="mug: seed is -1; it must be an integer of 0"):
        mug.member(-1)
    assert mug(radius=0.04).sizes["radius"] == 0.04


def test_a_family_of_ones_own_is_made_like_any_other(monkeypatch):
    monkeypatch.setattr(OBJECTS, "registered", {})

    @family({"side": Size(0.04, 0.02, 0.05)})
    def die(side: float) -> Made:
        """A die."""
        return Made([Box((side / 2,) * 3, position=(0.0, 0.0, side / 2))])

    ObjectRegistry.register(die)
    assert ObjectRegistry.load("die").extent == pytest.approx((0.04,) * 3)
    assert ObjectRegistry.load("die", seed=1).sizes != ObjectRegistry.load("die", seed=2).sizes
    assert ObjectRegistry.load("die").about == "A die"


def test_what_is_no_family_is_refused():
    with pytest.raises(DescriptorError, match="the length 'side' of a family is usually 0.1 m"):
        family({"side": Size(0.1, 0.02, 0.05)})

    @family({})
    def nothing():
        """Return no thing."""

    with pytest.raises(DescriptorError, match="the function of the family 'nothing' gave None"):
        nothing()
