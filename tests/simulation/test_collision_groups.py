"""Links that a descriptor lets overlap do so in physics, in any number, and no others do."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
import sapien

from layouts import Layout, Placement
from robot_layouts.simulation.sapien3.blueprint import (
    BITS,
    FLOOR,
    NO_FLOOR_CONTACT,
    USUAL,
    cover,
    overlap_words,
)
from robot_layouts.simulation.sapien3.world import BuiltWorld
from robots import AssetError, RobotDescriptor
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from tests.faults.toy_robots import descriptor, joint, link, robot, toy

POST = '<box size="0.06 0.06 0.2"/>'


def between(parent, child, up=0.2, kind="revolute"):
    plain = joint(f"to_{child}", parent, child, kind=kind)
    return plain.replace('xyz="0 0 0.3"', f'xyz="0 0 {up}"')


def stack(*ups, kinds=("revolute",)):
    """A column of posts, each so far above the last (m)."""
    names = [f"l{i}" for i in range(len(ups) + 1)]
    kinds = (*kinds, *("revolute",) * len(ups))
    joints = (
        between(one, other, up, kind)
        for one, other, up, kind in zip(names, names[1:], ups, kinds, strict=False)
    )
    return robot(*(link(name, POST) for name in names), *joints)


def comb(teeth):
    """The toy with many parts at the same place, all fixed to the hand: any two overlap."""
    parts = [f"p{i}" for i in range(teeth)]
    fixed = (link(name) + joint(f"j{name}", "hand", name, kind="fixed") for name in parts)
    return toy().replace("</robot>", f"{''.join(fixed)}</robot>"), parts


def after_a_second(world):
    """Return the largest position and speed of any joint that started from 0 (rad, rad/s)."""
    robots = world.robots.values()
    for each in robots:
        each.reset(np.zeros(len(each.joints)))
    for _ in range(100):
        world.system.step()
    return max(
        float(np.abs(values).max())
        for each in robots
        for values in (each.articulation.get_qpos(), each.articulation.get_qvel())
    )


def collide(one, other):
    """Tell whether two overlapping boxes with some collision groups collide in SAPIEN."""
    scene = sapien.Scene([sapien.physx.PhysxCpuSystem()])
    for groups, x, build in ((one, 0.0, "build"), (other, 0.05, "build_kinematic")):
        builder = scene.create_actor_builder()
        builder.add_box_collision(half_size=[0.1] * 3)
        builder.collision_groups = list(groups)
        getattr(builder, build)(name=build).set_pose(sapien.Pose([x, 0.0, 0.0]))
    scene.step()
    return any(point.separation < 0 for hit in scene.get_contacts() for point in hit.points)


@pytest.mark.parametrize(
    ("one", "other", "expected"),
    [
        ((1, 1, 0, 1), (1, 1, 0, 1), True),
        ((1, 1, 6, 1), (1, 1, 4, 1), False),
        ((1, 1, 1 << 31, 1), (1, 1, 1 << 31, 1), False),
        ((1, 1, 2, 1), (1, 1, 4, 1), True),
        ((1, 1, 6, 1), (1, 1, 4, 2), True),
        ((1, 1, 6, 65535), (1, 1, 4, 65535), False),
        ((1, 1, 6, 1 | 7 << 16), (1, 1, 4, 1), False),
        ((*FLOOR, 0, 0), (*NO_FLOOR_CONTACT, 0, 1), False),
        ((*FLOOR, 0, 0), (*USUAL, 0, 1), True),
        ((*NO_FLOOR_CONTACT, 0, 1), (*USUAL, 0, 0), True),
        ((*NO_FLOOR_CONTACT, 0, 1), (*NO_FLOOR_CONTACT, 0, 2), True),
    ],
)
def test_what_sapien_makes_of_the_groups(one, other, expected):
    assert collide(one, other) is collide(other, one) is expected


class TestCover:
    def pairs(self, *groups):
        return {frozenset(pair) for group in groups for pair in combinations(group, 2)}

    def test_no_pair_comes_in_that_was_not_named(self):
        random = np.random.default_rng(0)
        everything = sorted(map(sorted, self.pairs("abcdefghij")))
        for _ in range(30):
            chosen = random.random(len(everything)) < 0.6
            pairs = {frozenset(pair) for pair, one in zip(everything, chosen, strict=True) if one}
            given = {pair for pair in pairs if "a" in pair}
            held = self.pairs(*cover(pairs - given, given))
            assert pairs - given <= held <= pairs


def test_links_stand_still_that_the_guess_lets_overlap(tmp_path):
    """The second post reaches into the fourth, and the first one into the third."""
    urdf = tmp_path / "posts.urdf"
    urdf.write_text(stack(0.1, 0.05, 0.2, 0.2))
    guessed = RobotDescriptor.from_urdf(urdf, quiet=True)
    assert ("l0", "l2") in guessed.allowed_collisions
    assert after_a_second(BuiltWorld(Layout({"posts": Placement(guessed)}))) < 1e-3
    strict = replace(guessed, allowed_collisions=())
    assert after_a_second(BuiltWorld(Layout({"posts": Placement(strict)}))) > 0.1


def test_any_number_of_pairs(tmp_path):
    urdf = tmp_path / "toy.urdf"
    text, parts = comb(24)
    urdf.write_text(text)
    pairs = tuple((*combinations(parts, 2), *((part, "base") for part in parts)))
    toy_robot = replace(descriptor(urdf), allowed_collisions=pairs)
    assert len(pairs) == 300
    assert after_a_second(BuiltWorld(Layout({"toy": Placement(toy_robot)}))) < 1e-3


def test_links_of_two_robots_collide_whatever_each_allows(tmp_path):
    urdf = tmp_path / "posts.urdf"
    urdf.write_text(stack(0.1, 0.05))
    one = replace(RobotDescriptor.from_urdf(urdf, quiet=True), allowed_collisions=(("l0", "l2"),))
    places = {"one": Placement(one), "other": Placement(one, (0.03, 0.0, 0.0))}
    world = BuiltWorld(Layout(places))
    world.system.step()
    names = {
        name: {shape for link in each.articulation.links for shape in link.collision_shapes}
        for name, each in world.robots.items()
    }
    assert all(len(shapes) == 3 for shapes in names.values())
    numbers = {
        name: {shape.get_collision_groups()[3] & 0xFFFF for shape in shapes}
        for name, shapes in names.items()
    }
    assert numbers == {"one": {1}, "other": {2}}
    touching = {
        frozenset(body.entity.name for body in contact.bodies)
        for contact in world.scene.get_contacts()
        if contact.bodies[0].articulation != contact.bodies[1].articulation
    }
    assert frozenset({"l0", "l2"}) in touching


def test_a_robot_that_says_nothing_keeps_the_groups_of_native_s_loader(tmp_path):
    urdf = tmp_path / "toy.urdf"
    urdf.write_text(toy())
    urdf.with_suffix(".srdf").write_text(
        robot('<disable_collisions link1="base" link2="hand" reason="Default"/>')
    )
    for allowed, links_pass, expected in (
        (None, True, {(1, 1, 1, 0), (1, 1, 0, 0)}),
        (None, False, {(1, 1, 1, 1), (1, 1, 0, 1)}),
        ((), True, {(1, 1, 0, 1)}),
    ):
        changed = replace(descriptor(urdf), allowed_collisions=allowed)
        world = BuiltWorld(Layout({"toy": Placement(changed)}), links_pass=links_pass)
        links = world.robots["toy"].links.values()
        groups = [shape.get_collision_groups() for link in links for shape in link.collision_shapes]
        assert set(map(tuple, groups)) == expected


def test_more_groups_than_sapien_has_are_an_error_unless_they_never_meet(tmp_path):
    """Pairs without a common link or partner need a bit each."""
    urdf = tmp_path / "toy.urdf"
    count = BITS + 1
    sides = [(f"a{i}", f"b{i}") for i in range(count)]
    parts = [
        link(one) + joint(f"j{one}", "base", one) + link(other) + joint(f"j{other}", "arm", other)
        for one, other in sides
    ]
    text = toy().replace("</robot>", f"{''.join(parts)}</robot>")
    urdf.write_text(text)
    many = replace(descriptor(urdf), allowed_collisions=tuple(sides))
    model = read_model(read_urdf(urdf), urdf.as_posix())
    with pytest.raises(AssetError, match=rf"toy: SAPIEN keeps {BITS} groups .* take {count}; "):
        overlap_words(many, model, urdf)
    apart = text.replace('<origin xyz="0 0 0.3" rpy="0 0 0"/>', '<origin xyz="9 0 0"/>', 1)
    assert apart != text
    urdf.write_text(apart)
    model = read_model(read_urdf(urdf), urdf.as_posix())
    assert overlap_words(many, model, urdf) == {}
