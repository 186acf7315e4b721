"""Control modes that places of a layout say: kept in YAML, followed by splits and tasks."""

from __future__ import annotations

import pickle
from contextlib import closing
from dataclasses import replace

import pytest

import tasks
from layouts import Layout, Placement, face_to_face
from robots import CONTROL_MODES, DescriptorError, LayoutError, RobotRegistry, UnknownNameError

DELTAS, POSE = "pd_joint_delta_pos", "pd_ee_delta_pose"
PAIR = face_to_face({"left": "panda_wristcam", "right": "panda_wristcam"}, spacing=1.5)
TEXT = PAIR.to_yaml().replace("  right:\n", f"    control_mode: {POSE}\n  right:\n")


def test_yaml_keeps_them():
    cell = Layout.from_yaml(TEXT)
    assert cell["left"].control_mode == POSE
    assert cell["right"].control_mode is None
    assert cell.to_yaml() == TEXT
    assert cell != PAIR
    assert "control_mode" not in PAIR.to_yaml()
    assert f"{POSE}\n" in f"{cell}\n"


def test_splits_follow():
    cell = Layout.from_yaml(TEXT)
    assert cell.action_split == {"left": slice(0, 7), "right": slice(7, 15)}
    assert cell.robot_actions == cell.action_split
    assert cell.action_dim == len(cell.action_bounds) == 15
    assert cell["left"].robot == PAIR["left"].robot  # as it was declared
    assert cell.in_control_mode().control_modes == {}
    assert cell.in_control_mode().action_split == cell.action_split


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        (None, {"left": POSE}),
        (DELTAS, DELTAS),
        ({"right": POSE}, {"left": POSE, "right": POSE}),
        ({"left": "pd_joint_pos"}, {"left": "pd_joint_pos"}),
    ],
)
def test_tasks_follow_unless_asked(asked, expected):
    cell = Layout.from_yaml(TEXT)
    with closing(
        tasks.make("TwoRobotPickCube-v1", layout=cell, control_mode=asked, obs_mode="none")
    ) as task:
        assert task.control_mode == expected
        assert task.action_split == cell.in_control_mode(expected).action_split
        assert task.layout.control_modes == {}


def test_limbs_have_theirs():
    cell = Layout({"cell": Placement("baxter", control_mode={"left": POSE, "right": DELTAS})})
    assert cell["cell"].control_mode == f"left={POSE},right={DELTAS}"
    assert cell.control_modes == {"cell.left": POSE, "cell.right": DELTAS}
    assert Layout.from_yaml(cell.to_yaml()) == cell
    plain = Layout({"cell": Placement("baxter")})
    assert cell.action_dim == plain.action_dim - 1
    assert cell.control_mode({"left": "pd_joint_pos"}) == {
        "cell.right": DELTAS,
        "left": "pd_joint_pos",
    }
    assert cell.in_control_mode(DELTAS).action_dim == plain.action_dim


@pytest.mark.parametrize(
    ("mode", "error", "words"),
    [
        ("pd_ee_dance", UnknownNameError, "control mode 'pd_ee_dance'.* Did you mean 'pd_ee_pose'"),
        ({"left": POSE}, UnknownNameError, "limb of panda 'left'"),
        (3, LayoutError, "control_mode is 3; it takes a mode's name, such as 'pd_joint_delta_pos'"),
    ],
)
def test_what_is_none(mode, error, words):
    with pytest.raises(error, match=words):
        Placement("panda", control_mode=mode)


def test_a_wrong_one_in_yaml_has_its_line():
    with pytest.raises(LayoutError, match=r"line \d+: .*'pd_ee_delta_pos?e?s'"):
        Layout.from_yaml(TEXT.replace(POSE, "pd_ee_delta_poses"))


@pytest.mark.parametrize(
    "mode", [*CONTROL_MODES, {"left": POSE}, {"left": POSE, "right": "pd_joint_vel"}]
)
def test_what_was_put_into_a_mode_tells_it(mode):
    cell = pickle.loads(pickle.dumps(PAIR.in_control_mode(mode)))
    assert cell.control_mode() == mode
    assert cell.in_control_mode() == cell
    assert cell.in_control_mode(DELTAS) == PAIR  # and back
    assert cell.in_control_mode("pd_joint_pos") == PAIR.in_control_mode("pd_joint_pos")
    assert ("control mode" in str(cell)) == (mode != DELTAS)


def test_so_do_limbs():
    cell = Layout({"cell": Placement("baxter")}).in_control_mode({"left": POSE})
    assert cell.control_mode() == {"cell.left": POSE, "cell.right": DELTAS}
    assert cell.control_mode({"cell": "pd_joint_pos"}) == {"cell": "pd_joint_pos"}
    both = cell.in_control_mode({"right": POSE})
    assert both == Layout({"cell": Placement("baxter")}).in_control_mode(POSE)
    assert both.control_mode() == POSE


def test_what_was_changed_since_is_refused():
    panda = RobotRegistry.load("panda").in_control_mode(POSE)
    arm = replace(panda.action_split.groups["arm"], damping=3.0)
    odd = replace(panda, action_split=panda.action_split.replace(arm=arm))
    assert odd.control_mode is None
    cell = Layout({"arm": Placement(odd)})
    assert "none of its own" in str(cell)
    with pytest.raises(LayoutError, match=r"'arm': the joint groups of panda were changed after"):
        tasks.make("PickCube-v1", layout=cell)
    with pytest.raises(DescriptorError, match="its joint groups were changed then"):
        odd.in_control_mode("pd_joint_pos")
    with pytest.raises(DescriptorError, match="panda was put into a control mode; take it as it"):
        panda.with_gripper("panda")
