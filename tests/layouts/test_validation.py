"""What a check of a layout finds, how much, and what it says to change."""

import itertools
import math
import re
import sys
from dataclasses import replace

import numpy as np
import pytest

from layouts import Layout, Placement, around_table, side_by_side, yaw_quaternion
from layouts.frames import Pose
from layouts.validation.collisions import nearest, stand, touching
from robots import LayoutError, MissingPackageError, RobotRegistry, UnknownNameError
from robots.bodies.hulls import load_model
from robots.parts import PINCH
from tests.catalogue import every_robot
from tests.layouts.small_robots import FOLDING, folding, joint, link, robot, turntable, urdf

PANDAS = {"left": "panda", "right": "panda"}
TURN = joint("turn", "base", "top", xyz="0 0 0.35")
TABLE = (-0.7245, -1.209, 0.4845, 1.209)


def pair(robot_, distance, **placement):
    """Two robots side by side along y, still."""
    return Layout(
        {
            name: Placement(robot_, (0, y, 0), (1, 0, 0, 0), qpos_noise=0.0, **placement)
            for name, y in (("one", 0.0), ("other", distance))
        }
    )


def kinds(report):
    return [finding.kind for finding in report.findings]


class TestPandas:
    def test_at_ten_centimetres_they_are_refused_with_the_links_named(self):
        report = side_by_side(PANDAS, spacing=0.1).validate(workspaces=False)
        (finding,) = report.findings
        assert not report.ok
        assert (finding.kind, finding.robots) == ("collision", ("left", "right"))
        assert ("panda_link2", "panda_link1") in [pair.links for pair in finding.links]
        assert finding.amount == pytest.approx(0.110, abs=0.001)
        assert "left.panda_link2 with right.panda_link1 (11.0 cm)" in str(report)

    @pytest.mark.parametrize(("spacing", "clearance"), [(0.3, 0.041), (0.6, 0.341)])
    def test_farther_apart_they_pass_with_their_clearance(self, spacing, clearance):
        report = side_by_side(PANDAS, spacing=spacing).validate(workspaces=False)
        (between,) = report.clearances
        assert report.ok
        assert not report.findings
        assert between.distance == pytest.approx(clearance, abs=0.001)
        assert between.noisy_distance <= between.distance
        assert between.links == ("panda_link2", "panda_link1")
        assert f"left – right: {clearance * 100:.1f} cm" in str(report)

    def test_the_distance_that_it_advises_is_clear(self):
        crowded = side_by_side(PANDAS, spacing=0.1).validate(workspaces=False)
        advised = float(crowded.findings[0].advice.split("(")[1].split(" m ")[0])
        assert 0.2 < advised < 0.3
        moved = side_by_side(PANDAS, spacing=advised).validate(workspaces=False)
        assert not moved.findings
        nearer = side_by_side(PANDAS, spacing=advised - 0.02).validate(workspaces=False)
        assert nearer.findings


class TestDistances:
    def test_between_boxes_they_are_exact(self, tmp_path):
        report = pair(turntable(tmp_path), 0.25).validate(workspaces=False)
        (between,) = report.clearances
        assert between.distance == between.noisy_distance == pytest.approx(0.15, abs=1e-9)
        near, far = between.points
        assert math.dist(near, far) == pytest.approx(0.15, abs=1e-9)

    @pytest.mark.parametrize("distance", [0.03, 0.08, 0.0999])
    def test_overlaps_are_as_deep_as_they_are(self, distance, tmp_path):
        report = pair(turntable(tmp_path), distance).validate(workspaces=False)
        (finding,) = report.findings
        assert finding.amount == pytest.approx(0.1 - distance, abs=1e-6)
        assert [pair.links for pair in finding.links] == [("base", "base"), ("top", "top")]

    def test_a_turned_box_comes_nearer(self, tmp_path):
        arm = turntable(tmp_path, keyframes={"rest": [math.pi / 4]})
        (between,) = pair(arm, 0.25).validate(workspaces=False).clearances
        assert between.distance == pytest.approx(0.25 - 0.1 * math.sqrt(2), abs=1e-6)
        assert between.links == ("top", "top")

    def test_less_than_two_centimetres_is_a_warning(self, tmp_path):
        report = pair(turntable(tmp_path), 0.115).validate(workspaces=False)
        (finding,) = report.findings
        assert report.ok
        assert (finding.kind, finding.serious) == ("clearance", False)
        assert finding.amount == pytest.approx(0.015)
        assert "0.010 m farther apart (0.125 m between their bases" in finding.advice

    @pytest.mark.parametrize("seed", range(6))
    def test_the_nearest_links_are_the_nearest_of_all(self, seed):
        """Compared with FCL's answer for every pair of hulls, in random postures."""
        import fcl

        random = np.random.default_rng(seed)
        model = load_model(RobotRegistry.load("panda"))
        bodies = [
            stand(
                name,
                Pose((x, 0.0, 0.0), yaw_quaternion(x)),
                model,
                random.uniform(*model.kinematics.limits.T, (3, 9)),
            )
            for name, x in (("one", 0.0), ("other", 0.9))
        ]
        distances = [
            fcl.distance(
                *(
                    fcl.CollisionObject(hull.geometry, fcl.Transform(pose[:3, :3], pose[:3, 3]))
                    for hull, pose in ends
                ),
                fcl.DistanceRequest(enable_signed_distance=True),
            )
            for posture in range(3)
            for ends in itertools.product(
                *(zip(body.hulls, body.poses[posture], strict=True) for body in bodies)
            )
        ]
        assert nearest(*bodies).distance == pytest.approx(min(distances), abs=1e-9)
        assert len(touching(*bodies)) == sum(distance < 0 for distance in distances)

    @pytest.mark.parametrize("shape", ['<cylinder radius="0.05" length="0.1"/>'])
    def test_round_shapes_are_nearly_round(self, shape, tmp_path):
        text = urdf(link("base", shape), link("top", ""), joint("turn", "base", "top"))
        (between,) = pair(robot(tmp_path, text, ["turn"]), 0.3).validate().clearances
        assert between.distance == pytest.approx(0.2, abs=5e-4)

    def test_one_above_the_other_is_moved_the_shorter_way(self, tmp_path):
        """Their boxes are 10 cm wide, and 10 cm and 40 cm high; they overlap by 5 cm in height."""
        arm = turntable(tmp_path)
        layout = Layout({"one": Placement(arm), "other": Placement(arm, (0.01, 0.0, 0.35))})
        (finding,) = layout.validate(samples=0, workspaces=False).findings
        assert "0.070 m farther apart vertically (0.420 m between" in finding.advice


class TestSelfCollisions:
    def fold(self, tmp_path, elbow, noise=0.0, allowed=None, **more):
        arm = replace(folding(tmp_path, elbow), allowed_collisions=allowed)
        return Layout({"arm": Placement(arm, qpos_noise=noise)}).validate(**more)

    def test_links_that_fold_into_each_other_are_named(self, tmp_path):
        report = self.fold(tmp_path, math.pi - 0.01)
        (finding,) = report.findings
        assert finding.kind == "self-collision"
        assert [pair.links for pair in finding.links] == [("base", "lower")]
        assert finding.amount == pytest.approx(0.1, abs=0.01)
        assert "arm touches itself at the keyframes: arm.base with arm.lower" in finding.what

    def test_noise_alone_can_cause_them(self, tmp_path):
        still = self.fold(tmp_path, 2.7)
        noisy = self.fold(tmp_path, 2.7, noise=0.3, samples=50)
        assert still.ok
        (finding,) = noisy.findings
        assert "with joint noise (" in finding.what
        assert "less joint noise than qpos_noise=0.3 rad" in finding.advice

    def test_a_graze_of_a_folded_arm_that_noise_alone_causes_is_a_warning(self):
        layout = Layout({"arm": Placement("koch", keyframe="rest")})
        report = layout.validate(samples=300, workspaces=False)
        (finding,) = report.findings
        assert report.ok
        assert (finding.kind, finding.serious) == ("self-collision", False)
        assert 0 < finding.amount < 0.005

    def test_neighbours_may_touch(self, tmp_path):
        text = FOLDING.replace('<origin xyz="0.2 0 0"/>', '<origin xyz="0.09 0 0"/>')
        arm = robot(tmp_path, text, ["shoulder", "elbow"], tcp="lower")
        assert Layout({"arm": Placement(arm, qpos_noise=0.0)}).validate().ok

    @pytest.mark.parametrize(
        ("reason", "ok"), [("Default", True), ("default", True), ("Never", False), ("", False)]
    )
    def test_of_the_srdf_those_pairs_may_touch_that_physics_lets(self, reason, ok, tmp_path):
        (tmp_path / "small.srdf").write_text(
            f'<robot name="small"><disable_collisions link1="lower" link2="base"'
            f' reason="{reason}"/></robot>'
        )
        assert self.fold(tmp_path, math.pi - 0.01).ok == ok

    def test_the_descriptor_names_pairs_that_may_touch(self, tmp_path):
        assert self.fold(tmp_path, math.pi - 0.01, allowed=(("lower", "base"),)).ok
        assert not self.fold(tmp_path, math.pi - 0.01, allowed=()).ok
        with pytest.raises(UnknownNameError, match=r"'lowr'\. Did you mean 'lower'\?"):
            self.fold(tmp_path, math.pi - 0.01, allowed=(("lowr", "base"),))

    @pytest.mark.parametrize("name", every_robot())
    def test_no_keyframe_of_ours_has_one(self, name):
        """But for `pinch`, in which fingers meet."""
        for keyframe in RobotRegistry.load(name).keyframes.keys() - {PINCH}:
            layout = Layout({"arm": Placement(name, keyframe=keyframe)})
            report = layout.validate(workspaces=False)
            assert report.ok, str(report)


class TestTable:
    def validate(self, table=TABLE, **placement):
        layout = Layout({"arm": Placement("panda", qpos_noise=0.0, **placement)})
        return layout.validate(table=table, workspaces=False)

    def test_a_base_may_stand_on_it(self):
        report = self.validate()
        assert report.ok
        (above,) = report.clearances
        assert above.between == ("arm", "table")
        assert above.distance == pytest.approx(0.141, abs=0.001)

    def test_what_sinks_in_is_named_with_how_far_to_raise_it(self):
        (finding,) = self.validate(position=(0.0, 0.0, -0.2)).findings
        assert finding.kind == "table"
        assert finding.links[0].links == ("panda_link1", "table")
        assert finding.amount == pytest.approx(0.2 - 0.141, abs=0.001)
        assert "raise the base of arm by 0.069 m" in finding.advice

    @pytest.mark.parametrize("place", [(-0.4, 0.0, -0.2), (-0.4, 1.25, -0.3)])
    def test_raised_by_as_much_it_leaves_the_table(self, place):
        """Also if the nearest way out of it is over an edge."""
        (finding,) = self.validate(position=place).findings
        lift = float(re.search(r"by ([\d.]+) m", finding.advice)[1])
        assert self.validate(position=(*place[:2], place[2] + lift)).ok

    def test_tables_of_the_layout_count(self):
        layout = around_table({"a": "panda", "b": "so100"}, edges=["north", "south"])
        report = layout.validate(workspaces=False)
        assert report.ok
        assert {c.between for c in report.clearances if c.table} == {("a", "table"), ("b", "table")}
        sunk = Layout({"a": replace(layout["a"], position=(0.1, 0, -0.3))}, layout.frames)
        assert kinds(sunk.validate(workspaces=False)) == ["table"]

    @pytest.mark.parametrize("table", [(1, 0, 0, 1), (0, 0, 1, math.nan)])
    def test_one_that_is_no_rectangle_is_refused(self, table):
        with pytest.raises(LayoutError, match="must be x_min, y_min, x_max, y_max|takes 4 finite"):
            self.validate(table)


class TestJointLimits:
    def test_a_keyframe_beyond_them_is_found(self):
        panda = RobotRegistry.load("panda")
        bent = replace(panda, keyframes={"rest": (0, 0.39, 0, 0.5, 0, 2.36, 0.78, 0.04, 0.04)})
        report = Layout({"arm": Placement(bent)}).validate(workspaces=False)
        finding = next(f for f in report.findings if f.kind == "joint limit")
        assert not report.ok
        assert "puts panda_joint4 at 0.5 rad, 0.57 rad beyond its limits" in finding.what
        assert finding.amount == pytest.approx(0.5698, abs=1e-3)


class TestTargets:
    def test_who_reaches_what(self):
        layout = side_by_side({"left": "panda", "small": "so100"}, spacing=1.0)
        report = layout.validate(targets={"cube": (0.5, -0.5, 0.1)}, workspaces=False)
        reached = {reach.robot: reach.reached for reach in report.reaches}
        assert reached == {"left": True, "small": False}
        assert report.ok
        assert "cube (0.5, -0.5, 0.1): left reaches it, small stays" in str(report)

    def test_a_target_that_nobody_reaches_is_a_problem(self):
        layout = side_by_side(PANDAS, spacing=0.6)
        report = layout.validate(targets=[(3.0, 0.3, 0.5)], workspaces=False)
        (finding,) = report.findings
        assert (finding.kind, finding.robots) == ("target", ("right",))
        assert finding.amount == pytest.approx(2.0, abs=0.2)
        assert "no robot reaches target 1; right stays" in str(report)

    def test_a_target_inside_another_robot_is_reached_by_none(self):
        layout = side_by_side(PANDAS, spacing=0.6)
        inside = (0.0, 0.3, 0.5)
        report = layout.validate(targets={"shoulder": inside}, workspaces=False)
        left = next(reach for reach in report.reaches if reach.robot == "left")
        assert not left.reached
        assert left.blocked
        assert left.obstacles == ("right",)

    @pytest.mark.parametrize(
        ("target", "advice"),
        [
            ((0.0, 0.0, 0.05, 1, 0, 0, 0), "another orientation of cube; its place is in reach"),
            ((3.0, 0.0, 0.05, 1, 0, 0, 0), "move arm or cube by as much towards each other"),
        ],
    )
    def test_what_to_change_depends_on_what_is_missing(self, target, advice):
        report = Layout({"arm": Placement("panda")}).validate(targets={"cube": target})
        (finding,) = report.findings
        assert advice in finding.advice

    def test_a_turn_that_is_missing_is_told(self, tmp_path):
        """It turns about z only: the place is right, and half a turn about x is missing."""
        layout = Layout({"arm": Placement(turntable(tmp_path))})
        report = layout.validate(targets={"cube": (0, 0, 0.35, 0, 1, 0, 0)}, workspaces=False)
        (reach,) = report.reaches
        assert reach.turn_missing == pytest.approx(math.pi)
        assert "arm stays 0.0 cm and 3.14 rad away" in str(report)

    def test_one_below_the_table_is_reached_only_without_it(self):
        layout = Layout({"arm": Placement("panda")})
        below = {"below": (0.0, 0.0, -0.1)}
        free = layout.validate(targets=below, workspaces=False)
        report = layout.validate(targets=below, table=TABLE, workspaces=False)
        assert free.ok
        assert not report.ok
        (finding,) = report.findings
        assert "without a collision; arm would touch table there" in finding.what
        assert "move below away from table" in finding.advice

    @pytest.mark.parametrize(
        ("target", "message"),
        [
            ((1, 2), "target 'cube' is .* it takes x, y, z"),
            ("here", "target 'cube' is 'here'"),
            ((0, 0, math.nan), "target 'cube' is"),
            ((0, 0, 0, 1, 1, 0, 0), "has length 1.414; a rotation has length 1"),
        ],
    )
    def test_what_is_no_place_is_refused(self, target, message):
        layout = Layout({"arm": Placement("panda")})
        with pytest.raises(LayoutError, match=message):
            layout.validate(targets={"cube": target})


class TestWorkspaces:
    def test_nearer_robots_share_more(self):
        near, far = (side_by_side(PANDAS, spacing=d).validate(samples=0) for d in (0.4, 1.2))
        assert near.shared[0].volume > 2 * far.shared[0].volume > 0
        assert 0 < far.shared[0].shares[0] < near.shared[0].shares[0] < 1
        assert "left and right share" in str(near)

    def test_one_too_large_to_sample_is_left_out(self):
        report = Layout({"arm": Placement("floating_panda_gripper")}).validate(samples=0)
        assert report.workspaces == {}

    def test_a_volume_that_can_be_told_by_hand(self, tmp_path):
        """A slide along x and one along y: the TCP fills a square of 2 m × 2 m."""
        slides = urdf(
            link("base", ""),
            link("middle", ""),
            link("top", ""),
            joint("x", "base", "middle", kind="prismatic", axis="1 0 0", xyz="0 0 0.05"),
            joint("y", "middle", "top", kind="prismatic", axis="0 1 0"),
        ).replace('lower="-4" upper="4"', 'lower="-0.999" upper="0.999"')
        arm = robot(tmp_path, slides, ["x", "y"])
        report = Layout({"arm": Placement(arm)}).validate()
        assert report.workspaces["arm"] == pytest.approx(20 * 20 * 1e-3)


class TestDraws:
    def test_the_same_seed_gives_the_same_report(self):
        layout = side_by_side(PANDAS, spacing=0.3)
        one, same, other = (
            layout.validate(seed=seed, workspaces=False).clearances[0] for seed in (1, 1, 2)
        )
        assert one == same
        assert one.noisy_distance != other.noisy_distance
        assert one.distance == other.distance

    def test_without_noise_only_the_keyframes_count(self):
        report = side_by_side(PANDAS, spacing=0.3).validate(samples=0, workspaces=False)
        assert report.clearances[0].noisy_distance == report.clearances[0].distance
        assert "looked at the keyframes, without joint noise" in str(report)

    @pytest.mark.parametrize("samples", [-1, 1.5, "many"])
    def test_a_number_of_draws_that_is_none(self, samples):
        with pytest.raises(LayoutError, match="samples is .* it must be an integer of 0 or more"):
            side_by_side(PANDAS, spacing=0.3).validate(samples=samples)


class TestPicture:
    def picture(self, spacing, path, **more):
        from matplotlib.image import imread

        report = side_by_side(PANDAS, spacing=spacing).validate(workspaces=False, **more)
        assert report.picture(path) == path
        return (imread(path)[..., :3] * 255).astype(int)

    def test_overlaps_are_marked_in_red(self, tmp_path):
        red = np.array([0xB2, 0x18, 0x2B])
        marked = [
            (np.abs(self.picture(d, tmp_path / f"{d}.png") - red).max(axis=-1) < 20)[100:1050].sum()
            for d in (0.1, 0.3)
        ]
        assert marked[0] > 150
        assert marked[1] == 0

    def test_it_says_names_clearance_targets_and_verdict(self):
        from layouts.validation.report import draw

        layout = side_by_side(PANDAS, spacing=0.3)
        figure = draw(layout.validate(table=TABLE, targets={"cube": (0.4, 0, 0.1)}))
        plan = figure.axes[0]
        written = [text.get_text().strip() for text in plan.texts]
        assert {"left", "right", "cube", "4.1 cm"} <= set(written)
        assert plan.get_title(loc="right") == "ok"


def test_without_fcl_the_error_names_the_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "fcl", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'robot-layouts\[checks\]'"):
        side_by_side(PANDAS, spacing=0.3).validate()
