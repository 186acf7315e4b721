"""What an SRDF makes known of a robot: arms, grippers, TCPs, postures, pairs that may overlap."""

from __future__ import annotations

import pytest

from robot_layouts.__main__ import main
from robots import AssetError, UnknownNameError
from robots.from_urdf import guess_descriptor

from .urdf_parts import Parts


@pytest.fixture
def robot(tmp_path):
    """Write a robot of two arms on a post, whose hands and joints say nothing by their names."""
    parts = Parts()
    parts.link("post", size="0.1 0.1 0.5")
    for name, y in (("a", 0.3), ("b", -0.3)):
        end = parts.arm("post", name, f"0 {y} 0.2")
        parts.jaws(end, name)
        parts.frame(f"{name}_spot", end, "0.11 0 0")
    return parts.write(tmp_path)


def srdf(folder, text):
    path = folder / "given.srdf"
    path.write_text(f'<robot name="made">{text}</robot>', "utf-8")
    return path


def groups(*names):
    return "".join(
        f'<group name="{n}_manipulator"><chain base_link="post" tip_link="{n}_spot"/></group>'
        f'<group name="{n}_grasper"><link name="{n}_finger_one"/><link name="{n}_finger_two"/>'
        f'</group><end_effector name="{n}" parent_link="{n}_link6" group="{n}_grasper"'
        f' parent_group="{n}_manipulator"/>'
        for n in names
    )


def state(name, group, *positions):
    joints = "".join(
        f'<joint name="{group}_joint{i}" value="{x}"/>' for i, x in enumerate(positions, start=1)
    )
    return f'<group_state name="{name}" group="{group}_manipulator">{joints}</group_state>'


def test_groups_are_limbs_and_chains_end_in_tools(robot, tmp_path):
    both = '<group name="both"><group name="a_manipulator"/><group name="b_manipulator"/></group>'
    found = guess_descriptor(robot, srdf=srdf(tmp_path, groups("a", "b") + both))
    assert list(found.descriptor.limbs) == ["a", "b"]
    assert found.descriptor.action_split.groups["a_arm"].joints == tuple(
        f"a_joint{i}" for i in range(1, 7)
    )
    assert set(found.descriptor.action_split.groups["b_gripper"].joints) == {
        "b_slide_one",
        "b_slide_two",
    }
    assert [limb.tcp_link for limb in found.descriptor.limbs.values()] == ["a_spot", "b_spot"]
    assert "a TCP: the link a_spot, as given.srdf says" in found.reasons
    assert found.reasons[0].startswith("given.srdf: the arms are its groups a_manipulator (6 joi")


def test_what_is_in_no_group_is_held(robot, tmp_path):
    found = guess_descriptor(robot, srdf=srdf(tmp_path, groups("a")))
    assert found.descriptor.arm_joints == tuple(f"a_joint{i}" for i in range(1, 7))
    assert not found.descriptor.limbs
    held = [group for group in found.descriptor.action_split.groups.values() if group.held]
    assert {joint for group in held for joint in group.joints} >= {"b_joint1", "b_slide_one"}


def test_states_are_keyframes_and_home_is_where_it_rests(robot, tmp_path):
    home = (0.3, 0.4, 0.5, 0.1, 0.2, 0.3)
    states = state("home", "a", *home) + state("home", "b", *home) + state("far", "a", 9, 0)
    found = guess_descriptor(robot, srdf=srdf(tmp_path, groups("a", "b") + states))
    rest = dict(zip(found.descriptor.joints, found.descriptor.keyframe("rest"), strict=True))
    assert [rest[f"b_joint{i}"] for i in range(1, 7)] == pytest.approx(home)
    assert "home" in found.descriptor.keyframes
    assert "far" not in found.descriptor.keyframes
    assert any(
        "'far' of given.srdf is left out, as it is beyond the limits of a_joint1" in reason
        for reason in found.reasons
    )


def test_disabled_pairs_may_overlap(robot, tmp_path):
    pair = '<disable_collisions link1="a_link2" link2="b_link4" reason="Never"/>'
    found = guess_descriptor(robot, srdf=srdf(tmp_path, pair)).descriptor
    assert ("a_link2", "b_link4") in found.allowed_collisions
    assert ("a_link2", "b_link4") not in guess_descriptor(robot).descriptor.allowed_collisions


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        ('<group name="a"><joint name="a_joint"/></group>', UnknownNameError, "joint that given"),
        ('<group name="a"><link name="a_lnk1"/></group>', UnknownNameError, "'a_link1'"),
        ('<group name="a"><chain base_link="post" tip_link="x"/></group>', UnknownNameError, "'x'"),
        ('<group name="a"><group name="a"/></group>', AssetError, "is made of itself"),
        ('<end_effector name="e" parent_link="post" group="g"/>', UnknownNameError, "group that"),
        (
            '<group name="a"/><group_state name="s" group="a"><joint name="a_joint1" value="x"/>'
            "</group_state>",
            AssetError,
            "joint 'a_joint1' of the state 's'",
        ),
        ("<nothing", AssetError, "is not a URDF"),
    ],
)
def test_what_is_refused(robot, tmp_path, text, error, message):
    with pytest.raises(error, match=message):
        guess_descriptor(robot, srdf=srdf(tmp_path, text))


def test_the_command_takes_one(robot, tmp_path, capsys):
    given = str(srdf(tmp_path, groups("a")))
    assert main(["robots", "guess", str(robot), "--srdf", given, "--all"]) == 0
    assert "TCP: the link a_spot, as given.srdf says" in capsys.readouterr().out
