"""Checks of layouts whose robots' files change, or are invalid."""

import pytest

from layouts import Layout, Placement
from robots import AssetError, DescriptorError
from tests.layouts.small_robots import joint, link, robot, turntable, urdf
from tests.layouts.test_validation import TURN, kinds, pair


class TestFiles:
    """A robot whose files are invalid does not keep the others from being checked."""

    def layout(self, tmp_path, **others):
        text = urdf(link("base", '<mesh filename="gone.stl"/>'), link("top"), TURN)
        broken = Placement(robot(tmp_path, text, ["turn"]), (5.0, 0.0, 0.0), (1, 0, 0, 0))
        return Layout({"broken": broken, **others})

    def test_it_is_a_finding(self, tmp_path):
        near = {n: Placement("so100", (x, 0, 0), (1, 0, 0, 0)) for n, x in (("a", 0), ("b", 0.05))}
        report = self.layout(tmp_path, **near).validate(targets=[(0.0, -0.2, 0.2)])
        assert not report.ok
        assert kinds(report) == ["files", "collision", "target"]
        finding = report.findings[0]
        assert finding.robots == ("broken",)
        assert finding.what.startswith("broken cannot be checked: ")
        assert "refers to files that do not exist: " in finding.what
        assert "as if broken were not there" in finding.advice
        assert {reach.robot for reach in report.reaches} == {"a", "b"}
        assert report.picture(tmp_path / "cell.png").is_file()

    def test_alone_it_is_an_error(self, tmp_path):
        with pytest.raises(AssetError, match="refers to files that do not exist"):
            self.layout(tmp_path).validate()


class TestBadRobots:
    def validate(self, tmp_path, text, joints=("turn",), **more):
        arm = robot(tmp_path, text, joints, **more)
        return Layout({"arm": Placement(arm)}).validate()

    def test_one_without_a_joint_that_moves_is_refused(self, tmp_path):
        still = urdf(link("base"), link("top"), joint("turn", "base", "top", kind="fixed"))
        with pytest.raises(DescriptorError, match=r"'small' has no moving joints \['turn'\]"):
            self.validate(tmp_path, still)

    def test_a_flat_shape_and_a_link_that_weighs_nothing_are_repaired(self, tmp_path):
        nothing = '<inertial><mass value="0"/><inertia ixx="0" iyy="0" izz="0"/></inertial></link>'
        top = link("top").replace("</link>", nothing)
        flat = link("base", '<box size="0.1 0.1 0"/>')
        assert self.validate(tmp_path, urdf(flat, top, joint("turn", "base", "top"))).ok

    def test_an_entity_in_the_srdf_is_refused(self, tmp_path):
        (tmp_path / "small.srdf").write_text('<!DOCTYPE r [<!ENTITY x "y">]><robot/>')
        with pytest.raises(AssetError, match="declares XML entities"):
            Layout({"arm": Placement(turntable(tmp_path))}).validate()

    def test_a_changed_file_is_read_again(self, tmp_path):
        arm = turntable(tmp_path)
        before = pair(arm, 0.25).validate(workspaces=False).clearances[0].distance
        text = (tmp_path / "small.urdf").read_text()
        (tmp_path / "small.urdf").write_text(text.replace("0.1 0.1 0.1", "0.2 0.2 0.1"))
        after = pair(arm, 0.25).validate(workspaces=False).clearances[0].distance
        assert before - after == pytest.approx(0.1)
