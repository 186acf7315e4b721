"""Which links of a robot may overlap, as its descriptor says and as a guess sees it."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from robots import RobotDescriptor, UnknownNameError
from robots.bodies.allowed import allowed_pairs, joined_pairs, rigid_groups, rigid_pairs
from robots.bodies.hulls import load_model, read_hulls
from robots.bodies.overlaps import (
    MARGIN,
    always_overlapping,
    guess_allowed,
    neighbours,
    without_distant,
)
from robots.data_module import write_module
from robots.urdf.reading import read_model
from robots.urdf.srdf import ExcludedPair, read_excluded_pairs
from robots.urdf.summary import read_urdf
from robots.urdf.tree import kinematic_tree
from tests.layouts.small_robots import joint, link, robot, urdf

# A foot, rigid with the base that carries the arm; the arm's ring sits inside the foot, always.
STAND = urdf(
    link("foot", '<box size="0.4 0.4 0.2"/>'),
    link("base"),
    link("upper", xyz="0 0 0.3"),
    link("tool", xyz="0 0 0.2"),
    link("tip", xyz="0 0 0.4"),
    joint("bolt", "foot", "base", kind="fixed", xyz="0 0 0.2"),
    joint("turn", "base", "upper"),
    joint("bend", "upper", "tool", xyz="0 0 0.4", axis="0 1 0"),
    joint("glue", "tool", "tip", kind="fixed"),
)


def pair(*names):
    return frozenset(names)


@pytest.fixture
def stand(tmp_path):
    return robot(tmp_path, STAND, ["turn", "bend"], tcp="tool")


def model_of(descriptor):
    path = descriptor.urdf.locate()
    return read_model(read_urdf(path), path.as_posix()), path


def test_rigid_groups(stand):
    model, _ = model_of(stand)
    assert rigid_groups(model) == {
        "foot": ["foot", "base"],
        "upper": ["upper"],
        "tool": ["tool", "tip"],
    }
    assert rigid_pairs(model) == {pair("foot", "base"), pair("tool", "tip")}
    assert neighbours(model) == {
        *(pair(link, "upper") for link in ("foot", "base", "tool", "tip")),
    }


def test_what_a_descriptor_allows(stand):
    model, _ = model_of(stand)
    always = joined_pairs(model) | rigid_pairs(model)
    excluded = [
        ExcludedPair(("foot", "upper"), "Default"),
        ExcludedPair(("foot", "tool"), "Never"),
        ExcludedPair(("foot", "nose"), "Default"),
    ]
    assert allowed_pairs(stand, model, excluded) == always | {pair("foot", "upper")}
    own = replace(stand, allowed_collisions=(("tip", "foot"),))
    assert allowed_pairs(own, model, excluded) == always | {pair("foot", "tip")}
    wrong = replace(stand, allowed_collisions=(("tipp", "foot"),))
    with pytest.raises(
        UnknownNameError,
        match="unknown link in allowed_collisions of small 'tipp'. Did you mean 'tip'",
    ):
        allowed_pairs(wrong, model, excluded)


def test_links_that_may_overlap_make_no_pairs_of_hulls(stand):
    names = {
        pair(model.link_name(a), model.link_name(b))
        for model in [load_model(replace(stand, allowed_collisions=(("foot", "tip"),)))]
        for a, b in model.self_pairs
    }
    assert names == {
        pair("foot", "upper"),
        pair("foot", "tool"),
        pair("base", "tool"),
        pair("base", "tip"),
        pair("upper", "tip"),
    }


class TestGuess:
    def test_without_an_srdf_neighbours_across_fixed_joints_may(self, stand):
        pairs, (reason,) = guess_allowed(*model_of(stand))
        assert pairs == (("foot", "upper"), ("upper", "tip"))
        assert "neighbours across fixed joints" in reason

    @pytest.mark.parametrize("reason", ['reason="Never"', 'reason="Adjacent"', ""])
    def test_with_one_its_pairs_do_whatever_their_reason(self, stand, reason):
        beside = stand.urdf.locate().with_suffix(".srdf")
        beside.write_text(
            f'<robot name="small"><disable_collisions link1="tip" link2="foot" {reason}/>'
            f'<disable_collisions link1="foot" link2="base" {reason}/>'
            f'<disable_collisions link1="tip" link2="nose" {reason}/></robot>'
        )
        pairs, (why,) = guess_allowed(*model_of(stand))
        assert pairs == (("foot", "tip"),)
        assert "the SRDF's disabled pairs" in why

    def test_links_that_always_overlap_may(self, tmp_path):
        """The third link reaches back to the first whatever the joints do; the fourth does not."""
        text = urdf(
            link("base", '<sphere radius="0.3"/>'),
            link("upper", ""),
            link("lower"),
            link("hand", xyz="0.5 0 0"),
            joint("shoulder", "base", "upper"),
            joint("elbow", "upper", "lower", xyz="0.1 0 0"),
            joint("wrist", "lower", "hand", xyz="0.1 0 0"),
        )
        arm = robot(tmp_path, text, ["shoulder", "elbow", "wrist"], tcp="hand")
        model, path = model_of(arm)
        assert always_overlapping(model, path, joined_pairs(model)) == {pair("base", "lower")}
        assert guess_allowed(model, path)[0] == (("base", "lower"),)

    @pytest.mark.parametrize(("size", "allowed"), [(0.12, True), (0.08, False)])
    def test_what_the_link_after_next_is_inside_most_of_the_time_may_be(
        self, tmp_path, size, allowed
    ):
        """The third link is inside the first in three of four postures, or in half of them."""
        text = urdf(
            link("base", f'<box size="{size} {size} {size}"/>'),
            link("upper", ""),
            link("lower", '<box size="0.12 0.12 0.12"/>', xyz="0.1 0 0"),
            joint("shoulder", "base", "upper", xyz="0.03 0 0"),
            joint("elbow", "upper", "lower"),
        )
        arm = robot(tmp_path, text, ["shoulder", "elbow"], tcp="lower")
        found = guess_allowed(*model_of(arm))[0]
        assert found == ((("base", "lower"),) if allowed else ())

    def test_from_urdf_takes_it_or_what_is_given(self, stand):
        path = stand.urdf.locate()
        guessed = RobotDescriptor.from_urdf(path, quiet=True)
        assert guessed.allowed_collisions == (("foot", "upper"), ("upper", "tip"))
        given = RobotDescriptor.from_urdf(path, quiet=True, allowed_collisions=None)
        assert given.allowed_collisions is None
        scope = {}
        exec(write_module(guessed), scope)  # noqa: S102
        assert scope[guessed.name.upper()] == guessed


def test_links_left_out_as_distant_never_come_near(tmp_path):
    """The mast is longer than everything else together, but for one slide."""
    text = urdf(
        link("base"),
        link("mast", ""),
        link("head"),
        link("eye", xyz="0.1 0 0"),
        link("wheel"),
        link("lift", ""),
        link("arm", xyz="0.2 0 0"),
        joint("yaw", "base", "mast"),
        joint("nod", "mast", "head", xyz="0 0 1.5", axis="0 1 0"),
        joint("look", "head", "eye", xyz="0.1 0 0.1"),
        joint("roll", "base", "wheel", xyz="0.2 0 -0.1", axis="0 1 0"),
        joint("slide", "base", "lift", xyz="0.1 0 0", kind="prismatic").replace("4", "0.9"),
        joint("reach", "lift", "arm", axis="0 1 0"),
    )
    joints = ["yaw", "nod", "look", "roll", "slide", "reach"]
    model, path = model_of(robot(tmp_path, text, joints, tcp="arm"))
    pairs = frozenset(map(frozenset, combinations(model.collisions, 2)))
    left_out = pairs - without_distant(pairs, model, path)
    assert left_out == {
        *(pair(high, low) for high in ("head", "eye") for low in ("base", "wheel")),
        pair("head", "arm"),
    }
    tree, hulls = kinematic_tree(model), read_hulls(model, path)
    draws = np.random.default_rng(0).uniform(*tree.limits.T, (300, len(joints)))
    for poses in tree.forward(draws):
        corners = {
            tree.links[hull.link]: hull.corners @ poses[hull.link, :3, :3].T
            + poses[hull.link, :3, 3]
            for hull in hulls
        }
        for one, other in left_out:
            apart = np.linalg.norm(corners[one][:, None] - corners[other], axis=-1).min()
            assert apart > MARGIN


def test_the_srdf_of_a_ros_package_lies_in_a_folder_of_its_own(tmp_path):
    for folder in ("urdf", "srdf"):
        (tmp_path / folder).mkdir()
    urdf, srdf = tmp_path / "urdf" / "toy.urdf", tmp_path / "srdf" / "toy.srdf"
    assert read_excluded_pairs(urdf) == ()
    srdf.write_text('<robot name="toy"><disable_collisions link1="a" link2="b"/></robot>')
    assert read_excluded_pairs(urdf) == (ExcludedPair(("a", "b"), ""),)
    beside = urdf.with_suffix(".srdf")
    beside.write_text('<robot name="toy"/>')
    assert read_excluded_pairs(urdf) == ()
