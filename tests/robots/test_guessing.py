"""What a guess makes of robots that are written here: limbs, hands, tools, postures, drives."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot_layouts.simulation.checks.trial import try_robot
from robots import LocalUrdf, RobotDescriptor, RobotLayoutsError
from robots.bodies.hulls import load_model
from robots.bodies.overlaps import overlapping
from robots.from_urdf import Guess, guess_descriptor
from robots.gripper_motion import gripper_motion
from robots.guess import guess as guess_robot
from robots.guessing.hints import Hints
from robots.parts import PINCH, Fingers
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from tests.robots.urdf_parts import Parts


def guess(parts: Parts, folder: Path, shuffled: int | None = None) -> Guess:
    return guess_descriptor(parts.write(folder, shuffled=shuffled), "made")


def joints_of(guessed: Guess) -> dict[str, set[str]]:
    groups = guessed.descriptor.action_split.groups
    return {name: set(group.joints) for name, group in groups.items()}


def places(robot: RobotDescriptor, links: tuple[str, ...]) -> np.ndarray:
    """Return where links are at rest, in the base's frame, (links, 3) (m)."""
    tree = load_model(robot).kinematics
    poses = tree.forward(np.array(robot.keyframe("rest"))[None])[0]
    return np.array([poses[tree.link(link), :3, 3] for link in links])


def tcp(robot: RobotDescriptor) -> np.ndarray:
    return places(robot, robot.tcp_position_links or (robot.tcp_link,)).mean(axis=0)


def rest_overlaps(robot: RobotDescriptor) -> int:
    model = load_model(robot)
    poses = model.kinematics.forward(np.array(robot.keyframe("rest"))[None])[0]
    return int(overlapping(model.hulls, poses, model.self_pairs).sum())


def single_arm(end: str = "tool0", **arm: tuple[float, float]) -> tuple[Parts, str]:
    parts = Parts()
    parts.link("base_link", 5.0, "0.1 0.1 0.1", "0 0 0.05")
    last = parts.arm("base_link", "a", "0 0 0.12", **arm)
    if end:
        parts.frame(end, last, "0.05 0 0")
    return parts, last


def torso() -> Parts:
    parts = Parts()
    parts.link("trunk", 20.0, "0.2 0.2 0.6", "0 0 0.3")
    parts.link("lifted", 10.0, "0.2 0.2 0.2", "0 0 0.1")
    parts.joint("raise", "trunk", "lifted", "0 0 0.6", limits=(0.0, 0.3), kind="prismatic")
    return parts


class TestLimbs:
    @pytest.mark.parametrize("order", [None, 1, 2, 3])
    def test_two_arms_are_told_apart_by_where_they_stand(self, tmp_path, order):
        parts = torso()
        for name, y in (("b", -0.25), ("a", 0.25)):
            last = parts.arm("lifted", name, f"0 {y} 0.1")
            parts.jaws(last, name)
        found = guess(parts, tmp_path, order)
        assert list(joints_of(found))[:4] == [
            "left_arm", "left_gripper", "right_arm", "right_gripper",
        ]  # fmt: skip
        arm = {f"a_joint{i}" for i in range(1, 7)}
        assert joints_of(found)["left_arm"] == arm
        assert joints_of(found)["left_gripper"] == {"a_slide_one", "a_slide_two"}
        assert joints_of(found)["right_gripper"] == {"b_slide_one", "b_slide_two"}
        assert found.descriptor.action_dim == 14
        assert found.descriptor.action_split.groups["torso_slide"].held
        assert set(found.descriptor.arm_joints) == arm | {f"b_joint{i}" for i in range(1, 7)}

    def test_names_tell_the_sides_before_places_do(self, tmp_path):
        parts = torso()
        parts.arm("lifted", "left_arm", "0 -0.25 0.1")
        parts.arm("lifted", "right_arm", "0 0.25 0.1")
        found = joints_of(guess(parts, tmp_path))
        assert "left_arm_joint1" in found["left_arm"]

    def test_three_arms_have_numbers(self, tmp_path):
        parts = torso()
        for name, y in (("a", -0.3), ("b", 0.0), ("c", 0.3)):
            parts.arm("lifted", name, f"0.1 {y} 0.1")
        assert [name for name in joints_of(guess(parts, tmp_path)) if "arm" in name] == [
            "arm_1", "arm_2", "arm_3",
        ]  # fmt: skip

    @pytest.mark.parametrize("off", [False, True])
    def test_limbs_are_renamed_or_turned_off(self, tmp_path, off):
        parts = torso()
        for i, y in enumerate((-0.3, 0.0, 0.3), start=1):
            parts.arm("lifted", f"x{i}", f"0.1 {y} 0.1")
        file = parts.write(tmp_path)
        limbs = {"low": "1"} if off else {"low": "1", "high": "3"}
        found = guess_descriptor(file, limbs=limbs)
        groups = joints_of(found)
        assert set(found.descriptor.limbs) == (set() if off else {"low", "high"})
        assert groups["arm" if off else "low_arm"] == {f"x1_joint{i}" for i in range(1, 7)}
        assert {f"x2_joint{i}" for i in range(1, 7)} <= groups["body"]
        assert found.descriptor.action_dim == (6 if off else 12)
        assert any(r.startswith("held still: x2_joint1, ") for r in found.reasons)
        assert any("limbs={NAME: '1', NAME: '2'}" in r for r in guess_descriptor(file).doubts)

    @pytest.mark.parametrize(
        ("limbs", "message"),
        [
            ({"left": "4"}, "unknown limb '4'"),
            ({"left_arm": "1"}, "'left_arm' names no limb; it takes letters and digits"),
            ({"a": "1", "b": "1"}, "names a limb twice"),
        ],
    )
    def test_limbs_that_there_are_not_are_refused(self, tmp_path, limbs, message):
        parts = torso()
        for i, y in enumerate((-0.3, 0.0, 0.3), start=1):
            parts.arm("lifted", f"x{i}", f"0.1 {y} 0.1")
        with pytest.raises(RobotLayoutsError, match=message):
            guess_descriptor(parts.write(tmp_path), limbs=limbs)

    def test_head_wheels_and_legs_are_held_and_the_reason_says_how_to_drive_them(self, tmp_path):
        parts = torso()
        parts.arm("lifted", "a", "0.1 0 0.1")
        parts.link("neck")
        parts.joint("neck_pan", "lifted", "neck", "0 0 0.25")
        parts.link("camera")
        parts.joint("head_tilt", "neck", "camera", "0 0 0.05", axis="0 1 0")
        for side, y in (("l", 0.2), ("r", -0.2)):
            parts.link(f"{side}_wheel")
            parts.joint(f"{side}_drive", "trunk", f"{side}_wheel", f"0 {y} 0", kind="continuous")
            parts.link(f"{side}_thigh")
            parts.joint(f"{side}_hip", "trunk", f"{side}_thigh", f"0.1 {y} 0", axis="0 1 0")
            parts.link(f"{side}_shank")
            parts.joint(f"{side}_knee", f"{side}_thigh", f"{side}_shank", "0 0 -0.2")
        found = guess(parts, tmp_path)
        groups = found.descriptor.action_split.groups
        held = {name: set(group.joints) for name, group in groups.items() if group.held}
        assert held == {
            "torso_slide": {"raise"},
            "head": {"neck_pan", "head_tilt"},
            "legs": {"l_hip", "l_knee", "r_hip", "r_knee"},
            "wheels": {"l_drive", "r_drive"},
        }
        assert found.descriptor.action_dim == 6
        legs = next(reason for reason in found.reasons if reason.startswith("legs, held still"))
        assert "a JointGroup in the place of JointGroup.hold drives it" in legs

    def test_a_column_that_sinks_into_the_ground_is_let_through(self, tmp_path):
        parts = Parts()
        parts.link("world", at="0 0 0.1")
        parts.link("slid", at="0 0 0.1")
        reach = {"limits": (-5.0, 5.0), "kind": "prismatic"}
        parts.joint("along", "world", "slid", "0 0 0", axis="1 0 0", **reach)
        parts.link("turned", 20.0, "0.4 0.4 0.1", "0 0 0.1")
        parts.joint("about", "slid", "turned", "0 0 0", kind="continuous")
        parts.link("column", 10.0, "0.2 0.2 1.0", "0 0 -0.5")
        parts.joint("raise", "turned", "column", "0 0 0.3", limits=(0.0, 0.8), kind="prismatic")
        parts.arm("column", "a", "0 0 0.1")
        found = guess(parts, tmp_path)
        assert found.descriptor.no_floor_contact == ("column",)
        assert {"arm", "arm_slide"} <= joints_of(found).keys()  # and the arm alone moves the TCP
        moved = found.descriptor.in_control_mode("pd_ee_delta_pose").action_split.groups
        assert [name for name, group in moved.items() if group.asks.tcp] == ["arm"]
        assert any("column, below the ground that its base" in r for r in found.reasons)
        assert not try_robot(found.descriptor, 5).overlaps

    def test_a_robot_of_legs_alone_is_driven_all_the_same(self, tmp_path):
        parts = Parts()
        parts.link("trunk", 5.0, "0.4 0.2 0.1")
        for name, x, y in (("lf", 1, 1), ("rf", 1, -1), ("lh", -1, 1), ("rh", -1, -1)):
            parts.link(f"{name}_thigh", at="0 0 -0.1")
            at = f"{0.2 * x} {0.15 * y} 0"
            parts.joint(f"{name}_hip", "trunk", f"{name}_thigh", at, axis="0 1 0")
            parts.link(f"{name}_shank", at="0 0 -0.1")
            parts.joint(f"{name}_knee", f"{name}_thigh", f"{name}_shank", "0 0 -0.2", axis="0 1 0")
        found = guess(parts, tmp_path)
        assert found.descriptor.action_dim == 8
        assert any("arm: none is recognised, so the legs are driven" in r for r in found.reasons)

    def test_a_strut_that_follows_the_arm_does_not_end_it(self, tmp_path):
        parts, _ = single_arm()
        parts.link("strut")
        mimic = '<mimic joint="a_joint2"/>'
        parts.joint("strut_joint", "a_link2", "strut", "0.02 0 0.1", axis="0 1 0", mimic=mimic)
        found = guess(parts, tmp_path)
        assert joints_of(found)["arm"] == {f"a_joint{i}" for i in range(1, 7)}
        assert joints_of(found)["body"] == {"strut_joint"}


def knuckles(parts: Parts, palm: str) -> None:
    """Add a gripper of six joints of which one is driven; it is open at 0."""
    driven = '<mimic joint="drive" multiplier="{}"/>'
    for side, sign in (("left", 1), ("right", -1)):
        knuckle, finger = f"{side}_outer", f"{side}_pad"
        inner = parts.link(f"{side}_inner", 0.02, "0.04 0.01 0.02", "0.02 0 0")
        parts.link(knuckle, 0.02, "0.05 0.01 0.02", "0.025 0 0")
        parts.link(finger, 0.02, "0.06 0.01 0.02", "0.03 0 0")
        leads = side == "left"
        parts.joint(
            "drive" if leads else "right_outer_joint", palm, knuckle, f"0.04 {0.05 * sign} 0",
            axis="0 0 -1", limits=(0.0, 0.8) if leads else (-0.8, 0.0),
            mimic="" if leads else driven.format(-1),
        )  # fmt: skip
        parts.joint(
            f"{side}_pad_joint", knuckle, finger, "0.06 0 0", axis="0 0 1",
            limits=(0.0, 0.8) if leads else (-0.8, 0.0), mimic=driven.format(sign),
        )  # fmt: skip
        parts.joint(
            f"{side}_inner_joint", palm, inner, f"0.05 {0.02 * sign} 0", axis="0 0 -1",
            limits=(0.0, 0.8) if leads else (-0.8, 0.0), mimic=driven.format(sign),
        )  # fmt: skip


class TestHands:
    def test_a_shaft_that_moves_no_finger_is_held_still(self, tmp_path):
        parts, last = single_arm(end="")
        parts.jaws(last, "a")
        parts.link("shaft", 0.02, "0.01 0.01 0.01")
        parts.joint("gripper", last, "shaft", "0.02 0 0", axis="1 0 0", kind="continuous")
        found = guess(parts, tmp_path)
        groups = found.descriptor.action_split.groups
        assert groups["gripper"].joints == ("a_slide_one", "a_slide_two")
        assert groups["gripper_idle"].held
        assert groups["gripper_idle"].joints == ("gripper",)
        assert found.descriptor.fingers.max_angle == Fingers.max_angle  # they do not swing
        assert any("held still: gripper, by which no finger tip moves" in r for r in found.reasons)

    def test_a_mimic_tree_takes_one_number_that_drives_every_joint(self, tmp_path):
        parts, last = single_arm(end="")
        knuckles(parts, last)
        found = guess(parts, tmp_path)
        group = found.descriptor.action_split.groups["gripper"]
        assert (group.size, len(group.joints)) == (1, 6)
        low, high = group.ranges[0]
        closed = {j: m * low + o for j, (m, o) in zip(group.joints, group.followers, strict=True)}
        wide = {j: m * high + o for j, (m, o) in zip(group.joints, group.followers, strict=True)}
        assert closed == pytest.approx(
            {"drive": 0.8, "left_pad_joint": 0.8, "left_inner_joint": 0.8,
             "right_outer_joint": -0.8, "right_pad_joint": -0.8, "right_inner_joint": -0.8}
        )  # fmt: skip
        assert set(wide.values()) == {0.0}  # +1 opens, though the URDF closes upwards
        rest = dict(zip(found.descriptor.joints, found.descriptor.keyframe("rest"), strict=True))
        assert {rest[joint] for joint in group.joints} == {0.0}

    def test_the_joints_that_carry_fingers_lead_those_that_hang_on_them(self, tmp_path):
        parts, last = single_arm(end="")
        knuckles(parts, last)
        found = guess(parts, tmp_path)
        group = found.descriptor.action_split.groups["gripper"]
        assert group.leaders == ("drive", "right_outer_joint")
        assert group.lead == pytest.approx(0.1)
        assert min(group.armatures) > 0
        led = "a linkage, in which all joints go where drive and right_outer_joint are"
        assert any(led in reason for reason in found.reasons)

    def test_a_pad_inside_what_carries_it_is_what_touches(self, tmp_path):
        parts, last = single_arm(end="")
        knuckles(parts, last)
        for side, sign in (("left", 1), ("right", -1)):
            parts.link(f"{side}_rubber", 0.001, "0.06 0.004 0.02", "0 0 0")
            place = f"0.03 {-0.007 * sign} 0"
            parts.joint(f"{side}_glue", f"{side}_pad", f"{side}_rubber", place, kind="fixed")
        robot = guess(parts, tmp_path).descriptor
        assert robot.fingers.links == ("left_rubber", "right_rubber")
        assert set(robot.fingers.links) < set(robot.gripper_material.links)

    def test_what_a_finger_has_at_its_root_is_not_what_touches(self, tmp_path):
        parts, last = single_arm(end="")
        for side, sign in (("left", 1), ("right", -1)):
            finger = parts.link(f"{side}_finger", 0.02, "0.1 0.01 0.01", "0.05 0 0")
            root = f'<origin xyz="0 {-0.014 * sign} 0"/><geometry><box size="0.01 0.026 0.01"/>'
            block = f"<collision>{root}</geometry></collision></link>"  # reaches far inwards
            parts.links[-1] = parts.links[-1].replace("</link>", block)
            place, way = f"0.05 {0.03 * sign} 0", f"0 {sign} 0"
            slides = {"kind": "prismatic", "limits": (0.0, 0.02)}
            parts.joint(f"{side}_slide", last, finger, place, axis=way, **slides)
            parts.link(f"{side}_tip", 0.001, "0.03 0.004 0.02")
            place = f"0.085 {-0.006 * sign} 0"
            parts.joint(f"{side}_glue", finger, f"{side}_tip", place, kind="fixed")
        assert guess(parts, tmp_path).descriptor.fingers.links == ("left_tip", "right_tip")

    def test_a_gripper_that_turns_and_slides_is_driven_by_one_number(self, tmp_path):
        parts, last = single_arm(end="")
        parts.link("finger_a", 0.05, "0.06 0.01 0.02", "0.03 0 0")
        parts.joint("screw", last, "finger_a", "0.05 0.03 0", axis="0 0 1", limits=(0.0, 0.5))
        parts.link("finger_b", 0.05, "0.06 0.01 0.02", "0.03 0 0")
        parts.joint(
            "rack", last, "finger_b", "0.05 -0.03 0", axis="0 -1 0", limits=(0.0, 0.05),
            kind="prismatic", mimic='<mimic joint="screw" multiplier="0.1"/>',
        )  # fmt: skip
        group = guess(parts, tmp_path).descriptor.action_split.groups["gripper"]
        assert (group.joints, group.multipliers, group.ranges) == (
            ("screw", "rack"), (1.0, 0.1), ((0.0, 0.5),),
        )  # fmt: skip

    @pytest.mark.parametrize("limits", [(0.0, 0.03), (-0.03, 0.0)])
    def test_fingers_that_move_alike_or_mirrored_share_a_number(self, tmp_path, limits):
        parts, last = single_arm(end="")
        for name, sign in (("one", 1), ("two", -1)):
            parts.link(f"finger_{name}", 0.05, "0.06 0.01 0.02", "0.03 0 0")
            mirrored = limits[0] < 0 and sign < 0
            parts.joint(
                f"slide_{name}", last, f"finger_{name}", f"0.05 {0.008 * sign} 0",
                axis=f"0 {1 if mirrored else sign} 0", kind="prismatic",
                limits=limits if mirrored else (0.0, 0.03),
            )  # fmt: skip
        group = guess(parts, tmp_path).descriptor.action_split.groups["gripper"]
        assert group.mimic
        assert group.ranges == ((-0.01, 0.03),)
        assert group.multipliers == ((1.0, -1.0) if limits[0] < 0 else ())

    def test_a_hand_of_many_fingers_has_a_number_for_each_leader(self, tmp_path):
        parts, last = single_arm(end="")
        for i, y in enumerate((-0.03, 0.0, 0.03)):
            near, far = f"n{i}", f"f{i}"
            parts.link(near, 0.02, "0.03 0.01 0.01", "0.015 0 0")
            parts.link(far, 0.02, "0.03 0.01 0.01", "0.015 0 0")
            parts.joint(f"root{i}", last, near, f"0.05 {y} 0", axis="0 1 0", limits=(0.0, 1.5))
            mimic = f'<mimic joint="root{i}" multiplier="0.5" offset="0.1"/>' if i else ""
            parts.joint(f"end{i}", near, far, "0.04 0 0", limits=(0, 1.0), mimic=mimic)
        groups = guess(parts, tmp_path).descriptor.action_split.groups
        hand = {name: group for name, group in groups.items() if name != "arm"}
        assert {name: (group.joints, group.mimic) for name, group in hand.items()} == {
            "gripper": (("root0", "end0"), False),
            "gripper_root1": (("root1", "end1"), True),
            "gripper_root2": (("root2", "end2"), True),
        }
        assert groups["gripper_root1"].followers == ((1.0, 0.0), (0.5, 0.1))
        for finger in ("gripper_root1", "gripper_root2"):  # as firm as the one that is driven alone
            assert groups[finger].stiffness == groups["gripper"].stiffness

    @pytest.mark.parametrize("closed_at_0", [False, True])
    @pytest.mark.parametrize("thumb", ["thumb", "THJ"])
    def test_a_thumb_and_a_finger_meet_in_the_keyframe_pinch(self, tmp_path, closed_at_0, thumb):
        """Wherever the hand is open, at 0 or at the far stops; the finger beside bends alike."""
        apart, inwards = (0.001, -1) if closed_at_0 else (0.03, 1)  # m, and the sign of a turn
        parts, last = single_arm(end="")
        for name, x, y in ((thumb, 0.0, 1), ("FFJ", 0.0, -1), ("MFJ", 0.015, -1)):
            limits = (0.0, 1.2) if inwards * y > 0 else (-1.2, 0.0)
            carrier, at = last, f"{x} {apart * y} 0.02"
            for number in (1, 0):  # the last joint of a finger has the number 0
                link = parts.link(f"{name}{number}_link", 0.02, "0.01 0.01 0.05", "0 0 0.025")
                parts.joint(f"{name}{number}", carrier, link, at, axis="1 0 0", limits=limits)
                carrier, at = link, "0 0 0.05"
        robot = guess(parts, tmp_path).descriptor
        pinch, rest = (
            dict(zip(robot.joints, robot.keyframes[name], strict=True)) for name in (PINCH, "rest")
        )
        assert robot.fingers is not None
        assert robot.fingers.links == (f"{thumb}0_link", "FFJ0_link")
        assert [pinch["MFJ0"], pinch["MFJ1"]] == [pinch["FFJ0"], pinch["FFJ1"]]
        assert abs(rest["FFJ0"]) == pytest.approx(1.14 if closed_at_0 else 0.06)  # off its stop
        assert gripper_motion(robot).widest > 0.03  # m

    def test_the_hand_of_a_robot_whose_names_say_nothing_is_told_by_its_size(self, tmp_path):
        parts, last = single_arm(end="")
        for i, y in enumerate((-0.03, 0.03)):
            parts.link(f"x{i}", 0.02, "0.03 0.01 0.01", "0.015 0 0")
            parts.joint(f"y{i}", last, f"x{i}", f"0.05 {y} 0", axis="0 0 1", limits=(-0.5, 0.5))
        found = joints_of(guess(parts, tmp_path))
        assert found["gripper"] == {"y0", "y1"}
        assert len(found["arm"]) == 6

    def test_a_jaw_that_opens_downwards_opens_at_plus_one(self, tmp_path):
        parts, last = single_arm(end="")
        parts.link("fixed_part", 0.05, "0.1 0.01 0.02", "0.07 -0.01 0")
        parts.joint("mount", last, "fixed_part", "0.03 0 0", kind="fixed")
        parts.link("moving_jaw", 0.05, "0.08 0.01 0.02", "0.05 0 0")
        parts.joint("jaw", last, "moving_jaw", "0.05 0.01 0", axis="0 0 1", limits=(-1.0, 0.0))
        upside = parts.joints[-1].replace('axis xyz="0 0 1"', 'axis xyz="0 0 -1"')
        parts.joints[-1] = upside
        found = guess(parts, tmp_path)
        group = found.descriptor.action_split.groups["gripper"]
        (multiplier, offset), (low, high) = group.followers[0], group.ranges[0]
        assert multiplier * high + offset == -1.0
        assert multiplier * low + offset == 0.0
        assert len(found.descriptor.arm_joints) == 6

    def test_a_wrist_that_is_called_gripper_is_no_jaw(self, tmp_path):
        parts, _ = single_arm()
        parts.joints = [joint.replace("a_joint6", "gripper_roll") for joint in parts.joints]
        assert "gripper" not in joints_of(guess(parts, tmp_path))


def sliding(parts: Parts, palm: str, way: tuple[float, float, float]) -> None:
    """Add two fingers whose frames are the palm's and that slide apart along a direction."""
    for name, sign in (("one", 1), ("two", -1)):
        x, y, z = (sign * part for part in way)
        parts.link(f"finger_{name}", 0.05, "0.06 0.01 0.01", "0.03 0 0")
        parts.joint(
            f"slide_{name}", palm, f"finger_{name}", f"{0.05 + x / 100} {y / 100} {z / 100}",
            axis=f"{x} {y} {z}", limits=(0.0, 0.03), kind="prismatic",
        )  # fmt: skip


class TestFingers:
    @pytest.mark.parametrize(
        ("way", "axis"),
        [
            ((0.0, 1.0, 0.0), (0.0, 1.0, 0.0)),
            ((0.0, 0.8, 0.6), (0.0, 1.0, 0.0)),  # near enough
            ((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)),
            ((0.0, 0.6, 0.8), (0.0, 0.6, 0.8)),
        ],
    )
    def test_fingers_open_the_way_their_tips_part(self, tmp_path, way, axis):
        parts, last = single_arm(end="")
        sliding(parts, last, way)
        fingers = guess(parts, tmp_path).descriptor.fingers
        assert fingers.links == ("finger_one", "finger_two")
        assert fingers.opening_signs == (1, -1)
        assert fingers.opening_axes == (axis, axis)

    @pytest.mark.parametrize(("jaw", "wide"), [("jaw", 1.0), ("a_link_fngr", 2.2)])
    def test_a_jaw_opens_across_the_way_from_its_hinge(self, tmp_path, jaw, wide):
        parts, last = single_arm(end="")
        parts.link(jaw, 0.05, "0.08 0.01 0.02", "0.05 0 0")
        parts.joint("a_f1x", last, jaw, "0.03 0 0.03", axis="0 -1 0", limits=(0.0, wide))
        fingers = guess(parts, tmp_path).descriptor.fingers
        assert fingers.links == (last, jaw)
        assert fingers.max_angle == 110.0
        signed = np.array(fingers.opening_axes) * np.array(fingers.opening_signs)[:, None]
        assert signed[1] @ (0.0, 0.0, 1.0) > 0.95
        assert signed[0] @ (0.0, 0.0, -1.0) > 0.8

    @pytest.mark.parametrize("known", [True, False])
    def test_a_thumb_grasps_with_the_finger_that_it_meets(self, tmp_path, known):
        parts, last = single_arm(end="")
        ring, thumb, index = ("ring", "thumb", "index") if known else ("b", "c", "a")
        for name, y, z, axis in (
            (ring, -0.02, 0.03, 1), (thumb, 0.0, -0.03, -1), (index, 0.02, 0.03, 1)
        ):  # fmt: skip
            parts.link(name, 0.02, "0.06 0.01 0.01", "0.03 0 0")
            parts.joint(f"{name}_joint", last, name, f"0.05 {y} {z}", axis=f"0 {axis} 0",
                        limits=(0.0, 0.8))  # fmt: skip
        fingers = guess(parts, tmp_path).descriptor.fingers
        assert fingers.links == (thumb, index if known else ring)
        signed = np.array(fingers.opening_axes) * np.array(fingers.opening_signs)[:, None]
        assert (signed[0, 2], signed[1, 2]) == pytest.approx((-0.82, 0.82), abs=0.05)

    def test_a_finger_with_two_tips_grasps_with_one_of_them(self, tmp_path):
        """As a Talos has it: a broad finger with a tip at each end, and a narrow one."""
        parts, last = single_arm(end="")
        for finger, sign, tips in (("broad", 1, (-0.03, 0.03)), ("narrow", -1, (0.0,))):
            turns = {"axis": f"0 {sign} 0", "limits": (0.0, 0.8)}
            parts.link(finger, 0.02, "0.03 0.08 0.01", "0.015 0 0")
            parts.joint(f"{finger}_root", last, finger, f"0.05 0 {0.03 * sign}", **turns)
            for i, y in enumerate(tips):
                tip = parts.link(f"{finger}_tip{i}", 0.01, "0.03 0.01 0.01", "0.015 0 0")
                parts.joint(f"{tip}_joint", finger, tip, f"0.04 {y} 0", **turns)
        robot = guess(parts, tmp_path).descriptor
        assert robot.fingers.links == ("broad_tip0", "narrow_tip0")
        assert robot.tcp_offset[1:] == pytest.approx((0.0, 0.0), abs=1e-3)

    def test_a_reason_says_how_fingers_are_given(self, tmp_path):
        parts, last = single_arm(end="")
        for i, y in enumerate((-0.03, 0.0, 0.03)):
            parts.link(f"n{i}", 0.02, "0.03 0.01 0.01", "0.015 0 0")
            parts.joint(f"root{i}", last, f"n{i}", f"0.05 {y} 0", axis="0 1 0", limits=(0.0, 1.5))
        found = guess(parts, tmp_path)
        assert found.descriptor.fingers is None
        reason = next(r for r in found.reasons if r.startswith("fingers"))
        assert "Fingers((LINK, LINK), opening_signs=(1, 1), opening_axes=(WAY, WAY))" in reason


class TestTool:
    def test_a_frame_between_the_fingers_goes_before_the_palm(self, tmp_path):
        parts, last = single_arm(end="")
        parts.jaws(last, "a")
        parts.frame("hand_camera_frame", last, "0.11 0 0")
        parts.frame("ee_link", last, "0 0 0")  # where the gripper is screwed on
        parts.frame("grasptarget", last, "0.1 0 0")
        assert guess(parts, tmp_path).descriptor.tcp_link == "grasptarget"

    def test_a_tcp_far_from_the_tips_is_kept_and_doubted(self, tmp_path):
        parts, last = single_arm(end="")
        parts.jaws(last, "a")
        parts.frame("tcp", last, "0.2 0 0")
        found = guess(parts, tmp_path)
        assert found.descriptor.tcp_link == "tcp"
        (doubt,) = (reason for reason in found.doubts if reason.startswith("TCP"))
        assert "the finger tips meet 9 cm away, where no frame lies: tcp_offset=(-0.09" in doubt

    def test_finger_tips_go_before_the_flange(self, tmp_path):
        parts, last = single_arm(end="")
        parts.jaws(last, "a")
        parts.frame("ee_link", last, "0 0 0")
        parts.frame("tip_one", "a_finger_one", "0.06 0 0")
        parts.frame("tip_two", "a_finger_two", "0.06 0 0")
        robot = guess(parts, tmp_path).descriptor
        assert robot.tcp_position_links == ("tip_one", "tip_two")
        assert robot.tcp_link == "a_link6"

    def test_without_a_frame_the_tcp_is_where_the_tips_meet(self, tmp_path):
        parts, last = single_arm(end="")
        for name, sign in (("one", 1), ("two", -1)):
            finger = f"finger_{name}"
            parts.link(finger, 0.05, "0.2 0.01 0.02", "0.15 0 0")
            at = f"0.05 {0.01 * sign} 0"
            parts.joint(f"s_{name}", last, finger, at, axis=f"0 {sign} 0", kind="prismatic",
                        limits=(0.0, 0.03))  # fmt: skip
        found = guess(parts, tmp_path)
        assert found.descriptor.tcp_link == last
        np.testing.assert_allclose(found.descriptor.tcp_offset, (0.3, 0.0, 0.0), atol=0.02)
        reason = next(r for r in found.reasons if r.startswith("TCP"))
        assert reason.startswith("TCP: 30 cm from the link a_link6, where the finger tips meet")

    def test_a_frame_that_is_not_between_the_tips_is_moved_there(self, tmp_path):
        parts, last = single_arm(end="")
        parts.jaws(last, "a")  # whose tips meet 0.106 m ahead
        parts.frame("ee_link", last, "0.08 0.005 0")
        found = guess(parts, tmp_path)
        assert found.descriptor.tcp_link == "ee_link"
        np.testing.assert_allclose(found.descriptor.tcp_offset, (0.026, -0.005, 0), atol=0.005)
        assert any(r.startswith("TCP: 3 cm from the link ee_link") for r in found.reasons)

    @pytest.mark.parametrize("end", ["tool0", "ee_link", "suction_cup", "flange"])
    def test_an_arm_without_gripper_ends_in_its_tool(self, tmp_path, end):
        parts, last = single_arm(end)
        parts.frame("wrist_camera_link", last, "0.3 0 0")
        assert guess(parts, tmp_path).descriptor.tcp_link == end


class TestPosture:
    def test_the_tcp_is_ahead_of_the_robot_above_the_ground(self, tmp_path):
        parts, _ = single_arm()
        robot = guess(parts, tmp_path).descriptor
        x, y, z = tcp(robot)
        assert x > 0.3 * robot.reach
        assert abs(y) < 0.1
        assert z > 0.02
        assert rest_overlaps(robot) == 0

    @pytest.mark.parametrize(("yaw", "front"), [((0.57, 2.57), (0, 1)), ((2.14, 4.14), (-1, 0))])
    def test_front_is_where_the_arm_works(self, tmp_path, yaw, front):
        parts, _ = single_arm(yaw=yaw)
        robot = guess(parts, tmp_path).descriptor
        ahead = tcp(robot)[:2]
        assert ahead @ front > 0.3 * robot.reach
        assert ahead @ front > 0.8 * np.linalg.norm(ahead)

    def test_links_that_overlap_as_the_joints_stand_are_moved_apart(self, tmp_path):
        parts, _ = single_arm()
        parts.link("post", 1.0, "0.05 0.05 0.4", "0 0 0")  # where the arm reaches out at 0
        parts.joint("post_joint", "base_link", "post", "0.3 0 0.2", kind="fixed")
        path = parts.write(tmp_path)
        robot = guess_descriptor(path, "made").descriptor
        assert rest_overlaps(robot) == 0
        model = load_model(robot)
        poses = model.kinematics.forward(np.zeros((1, 6)))[0]
        assert overlapping(model.hulls, poses, model.self_pairs).any()

    def test_a_posture_that_is_fine_is_kept(self, tmp_path):
        parts, _ = single_arm()
        bent = {"a_joint2": -0.5, "a_joint3": 1.1}  # by other zeros of these joints
        for i, joint in enumerate(parts.joints):
            for name, angle in bent.items():
                if f'"{name}"' in joint:
                    parts.joints[i] = joint.replace("<origin ", f'<origin rpy="0 {angle} 0" ')
        found = guess(parts, tmp_path)
        assert found.descriptor.keyframe("rest") == (0.0,) * 6
        assert any("keyframe 'rest': joints at 0" in reason for reason in found.reasons)

    @pytest.mark.parametrize(
        ("at", "why"),
        [
            ({"a_joint3": 1.7, "a_joint4": 1.7, "a_joint5": 0.5}, "links overlap"),
            ({"a_joint2": -1.6, "a_joint3": -1.6}, "the TCP is behind the limb in it"),
        ],
    )
    def test_a_known_posture_that_is_no_good_is_not_the_one_to_start_in(self, tmp_path, at, why):
        parts, _ = single_arm()
        joints = {f"a_joint{i}": at.get(f"a_joint{i}", 0.0) for i in range(1, 7)}
        hints = Hints(source="the file", postures={"home": joints})
        found = guess_robot(LocalUrdf(str(parts.write(tmp_path))), None, {}, hints=hints)
        robot = found.descriptor
        assert robot.keyframe("home") == tuple(joints.values())
        assert robot.keyframe("rest") != robot.keyframe("home")
        assert rest_overlaps(robot) == 0
        said = f"keyframe 'rest' is not the posture 'home' of the file: {why}"
        assert any(reason.startswith(said) for reason in found.reasons)

    def test_a_known_posture_is_kept_but_off_its_stops(self, tmp_path):
        parts, _ = single_arm()
        joints = {f"a_joint{i}": 0.0 for i in range(1, 7)} | {"a_joint6": 1.8}
        hints = Hints(source="the file", postures={"home": joints})
        found = guess_robot(LocalUrdf(str(parts.write(tmp_path))), None, {}, hints=hints)
        assert found.descriptor.keyframe("rest") == pytest.approx([0, 0, 0, 0, 0, 1.62])
        assert any("off it" in r for r in found.reasons if r.startswith("keyframe 'rest'"))

    def test_slides_take_no_joint_noise_and_telescopes_may_overlap(self, tmp_path):
        parts = Parts()
        parent = parts.link("base", 5.0, "0.3 0.3 0.1")
        for i in range(1, 4):  # each starts inside the one before
            child = parts.link(f"tube{i}", size=f"{0.4 - 0.02 * i} 0.05 0.05", at="0.2 0 0")
            at = "0 0 0.3" if i == 1 else "0.02 0 0"
            parts.joint(f"out{i}", parent, child, at, axis="1 0 0", limits=(0.0, 0.3),
                        kind="prismatic")  # fmt: skip
            parent = child
        parts.arm(parent, "a", "0.4 0 0.1")
        robot = guess(parts, tmp_path).descriptor
        groups = robot.action_split.groups
        assert groups["arm_slide"].joints == ("out1", "out2", "out3")
        assert not groups["arm_slide"].reset_noise
        assert groups["arm"].reset_noise
        assert ("tube1", "tube3") in robot.allowed_collisions

    @pytest.mark.parametrize("turns_first", [True, False])
    def test_a_base_that_turns_and_slides_far_is_no_part_of_the_arm(self, tmp_path, turns_first):
        parts = Parts()
        parts.link("ground", 1.0)
        parts.link("platform", 5.0, "0.3 0.3 0.1")
        far: dict[str, Any] = {"limits": (-1e3, 1e3), "kind": "prismatic"}
        if turns_first:
            parts.link("turned")
            parts.joint("wheel_yaw", "ground", "turned", "0 0 0")
            parts.joint("way", "turned", "platform", "0 0 0", axis="1 0 0", **far)
            base = {"wheel_yaw", "way"}
        else:
            parts.link("along_x")
            parts.link("along_y")
            parts.joint("x", "ground", "along_x", "0 0 0", axis="1 0 0", **far)
            parts.joint("y", "along_x", "along_y", "0 0 0", axis="0 1 0", **far)
            parts.joint("th", "along_y", "platform", "0 0 0")
            base = {"x", "y", "th"}
        parts.arm("platform", "a", "0 0 0.1")
        groups = joints_of(guess(parts, tmp_path))
        assert groups["arm"] == {f"a_joint{i}" for i in range(1, 7)}
        assert groups.get("base", set()) | groups["base_slide"] == base

    def test_joints_stay_away_from_their_limits(self, tmp_path):
        parts, _ = single_arm()
        path = parts.write(tmp_path)
        robot = guess_descriptor(path, "made").descriptor
        spans = {j.name: j.span for j in read_model(read_urdf(path), str(path)).moving}
        for joint, position in zip(robot.joints, robot.keyframe("rest"), strict=True):
            low, high = spans[joint]
            assert low + 0.1 * (high - low) <= position <= high - 0.1 * (high - low)

    def test_it_is_the_same_every_time(self, tmp_path):
        path = single_arm()[0].write(tmp_path)
        assert guess_descriptor(path, "a").descriptor.keyframes == (
            guess_descriptor(path, "b").descriptor.keyframes
        )


class TestReasons:
    def test_each_is_one_sentence(self, tmp_path):
        parts = torso()
        for name, y in (("b", -0.25), ("a", 0.25)):
            last = parts.arm("lifted", name, f"0 {y} 0.1")
            parts.jaws(last, name)
        reasons = guess(parts, tmp_path).reasons
        assert len(reasons) == len(set(reasons))
        for reason in reasons:
            assert "\n" not in reason
            assert ". " not in reason
            assert not reason.endswith(".")

    def test_a_side_is_told_where_there_are_two(self, tmp_path):
        parts = torso()
        for name, y in (("b", -0.25), ("a", 0.25)):
            parts.arm("lifted", name, f"0 {y} 0.1")
        reasons = guess(parts, tmp_path).reasons
        for start in ("left arm: a_joint1", "right arm: b_joint1", "left TCP", "right TCP"):
            assert any(reason.startswith(start) for reason in reasons)


def test_rotors_are_no_fingers(tmp_path):
    parts = Parts()
    parts.link("body", 1.0, "0.2 0.2 0.05")
    for i, (x, y) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        parts.link(f"x{i}", 0.01)
        parts.joint(f"y{i}", "body", f"x{i}", f"{0.12 * x} {0.12 * y} 0.05", kind="continuous")
    assert not any("gripper" in name for name in joints_of(guess(parts, tmp_path)))
