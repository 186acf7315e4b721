"""Descriptors guessed from a URDF: how good, how explained, and what is refused."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from itertools import chain
from pathlib import Path

import pytest

from robot_layouts.__main__ import main
from robots import (
    AssetError,
    DescriptorError,
    MissingPackageError,
    RobotDescriptor,
    RobotRegistry,
    UnknownNameError,
    UrdfLocator,
)
from robots.assets.manifest import find_package, load_manifest
from robots.data_module import write_module
from robots.from_urdf import Guess, guess_descriptor
from robots.registry import CATALOGUE
from robots.registry import ROBOTS as CATALOGUED
from tests.robots.urdf_parts import Parts

CHECKOUT = Path(__file__).parents[2]
# What is guessed of these is right. One that the guess gets wrong is left out, and says why here.
ROBOTS = (
    "fetch",
    "floating_panda_gripper",
    "koch",
    "mobile_panda",
    "panda",
    "panda_pinch",
    "panda_stick",
    "panda_wristcam",
    "so100",
    "xarm7",
)


def urdf_of(robot: str) -> Path:
    locator = RobotRegistry.load(robot).urdf
    assert isinstance(locator, UrdfLocator)
    package = load_manifest().package(locator.package)
    return find_package("mani_skill") / package.origin.folder / locator.file


def guess(robot: str) -> Guess:
    return guess_descriptor(urdf_of(robot), robot)


class TestQuality:
    """Every robot of the catalogue, guessed from its URDF, beside what people wrote of it."""

    @pytest.mark.parametrize("robot", ROBOTS)
    def test_the_gripper_is_found_and_what_drives_it(self, robot):
        known, guessed = RobotRegistry.load(robot), guess(robot).descriptor
        expected = known.action_split.groups.get("gripper")
        found = guessed.action_split.groups.get("gripper")
        assert (found is None) == (expected is None)
        if found is not None and expected is not None:
            assert set(found.joints) == set(expected.joints)
            assert (found.mimic, found.unit) == (expected.mimic, expected.unit)
            if not expected.delta:
                assert found.ranges == expected.ranges
            assert guessed.gripper_material is not None
            assert known.gripper_material is not None
            assert set(guessed.gripper_material.links) == set(known.gripper_material.links)

    @pytest.mark.parametrize("robot", ROBOTS)
    def test_arm_and_base_are_told_apart(self, robot):
        known, guessed = RobotRegistry.load(robot), guess(robot).descriptor
        held = {
            joint
            for part in ("head", "torso", "torso_slide")
            if (group := guessed.action_split.groups.get(part))
            for joint in group.joints
        }
        assert set(guessed.arm_joints) == set(known.arm_joints) - held
        assert set(guessed.joints) == set(known.joints)
        assert guessed.action_dim == known.action_dim - len(held)
        arm = guessed.action_split.groups["arm"]
        assert arm.delta
        if "arm" in known.action_split.groups:
            assert arm.joints == known.action_split.groups["arm"].joints
            expected = known.action_split.groups["arm"].limits
            assert list(chain(*arm.limits)) == pytest.approx(list(chain(*expected)))

    @pytest.mark.parametrize("robot", ROBOTS)
    def test_the_tool_centre_point_is_found(self, robot):
        known, guessed = RobotRegistry.load(robot), guess(robot).descriptor
        assert guessed.tcp_link == known.tcp_link
        assert guessed.tcp_position_links == known.tcp_position_links

    @pytest.mark.parametrize("robot", ROBOTS)
    def test_the_reach_is_within_a_sixth(self, robot):
        """Data sheets measure to the flange, so that a Panda's guess is 11 % above its own."""
        known, guessed = RobotRegistry.load(robot), guess(robot).descriptor
        assert 0.95 <= guessed.reach / known.reach <= 7 / 6

    @pytest.mark.parametrize("robot", [n for n in ROBOTS if n not in ("so100", "koch")])
    def test_sliding_fingers_open_as_they_do(self, robot):
        known, guessed = RobotRegistry.load(robot).fingers, guess(robot).descriptor.fingers
        assert (known is None) == (guessed is None)
        if known is not None and guessed is not None:
            expected = dict(zip(known.links, known.opening_signs, strict=True))
            assert dict(zip(guessed.links, guessed.opening_signs, strict=True)) == expected


class TestWhatIsSaid:
    def test_every_guess_has_a_reason(self, capsys):
        robot = RobotDescriptor.from_urdf(urdf_of("panda"), "mine")
        said = capsys.readouterr().err
        assert said.startswith("mine: 9 joints, 8 action numbers, all guessed\n")
        for reason in (
            "gripper: panda_finger_joint1, panda_finger_joint2, as panda_hand carries 2",
            "arm: panda_joint1, ",
            "gripper, mimic joints, from the URDF: panda_finger_joint2 follows panda_finger_joint1",
            "gripper: +1 opens it, with panda_finger_joint1 at 0.04 m",
            "TCP: the link panda_hand_tcp, named like tcp",
            "drives: stiffness from the inertia that hangs on each joint",
            "keyframe 'rest': ",
            "fingers: panda_leftfinger and panda_rightfinger slide open along their y axis",
            "reach: the TCP's largest distance",
        ):
            assert f"\n  {reason}" in said
        assert RobotDescriptor.from_urdf(urdf_of("panda"), "mine", quiet=True) == robot
        assert capsys.readouterr().err == ""

    def test_what_is_known_better_is_taken(self):
        guess = guess_descriptor(urdf_of("panda"), reach=0.855, tcp_link="panda_hand")
        assert (guess.descriptor.reach, guess.descriptor.tcp_link) == (0.855, "panda_hand")
        assert "reach: given, not guessed" in guess.reasons
        with pytest.raises(DescriptorError, match=r"no fields \['reech'\]; it has name, urdf"):
            guess_descriptor(urdf_of("panda"), reech=0.855)

    @pytest.mark.parametrize(
        ("given", "link", "links", "offset"),
        [
            ({"tcp_offset": (0, 0, 0.095)}, "arm_link6", (), (0, 0, 0.095)),
            ({"tcp_link": "arm_link5"}, "arm_link5", (), (0, 0, 0)),
            ({"tcp_position_links": ("left", "right")}, "arm_link6", ("left", "right"), (0, 0, 0)),
            (
                {"tcp_offset": (0.01, 0, 0), "tcp_position_links": ("left", "right")},
                "arm_link6",
                ("left", "right"),
                (0.01, 0, 0),
            ),
        ],
    )
    def test_what_is_given_of_the_tcp_replaces_the_guess_of_it(
        self, tmp_path, given, link, links, offset
    ):
        parts = Parts()
        palm = parts.arm(parts.link("base"), "arm", "0 0 0.1")
        for side, sign in (("left", 1), ("right", -1)):
            parts.link(side, 0.05, "0.012 0.01 0.02", "0 0 0")
            axis, at = f"0 {sign} 0", f"0.05 {0.006 * sign} 0"
            parts.joint(side, palm, side, at, axis=axis, limits=(0, 0.04), kind="prismatic")
        path = parts.write(tmp_path)
        guessed = guess_descriptor(path)
        assert guessed.descriptor.tcp_position_links == ("left", "right")
        made = guess_descriptor(path, **given)
        robot = made.descriptor
        assert (robot.tcp_link, robot.tcp_position_links, robot.tcp_offset) == (link, links, offset)
        assert robot.reach != guessed.descriptor.reach or links
        assert not any("the middle of" in reason for reason in made.reasons)

    def test_a_tcp_that_makes_no_sense_is_refused(self, tmp_path):
        parts = Parts()
        parts.arm(parts.link("base"), "arm", "0 0 0.1")
        path = parts.write(tmp_path)
        with pytest.raises(DescriptorError, match="tcp_offset is 'up'; "):
            guess_descriptor(path, tcp_offset="up")
        with pytest.raises(UnknownNameError, match="'arm_link7'. Did you mean 'arm_link"):
            guess_descriptor(path, tcp_link="arm_link7")

    def test_two_arms_have_groups_of_their_own(self):
        dual = guess_descriptor(urdf_of("panda").with_name("mobile_panda_dual_arm.urdf")).descriptor
        groups = dual.action_split.groups
        assert list(groups)[:4] == ["left_arm", "left_gripper", "right_arm", "right_gripper"]
        assert [groups[name].size for name in list(groups)[:4]] == [7, 1, 7, 1]
        assert groups["torso_slide"].held
        assert dual.arm_joints == (*groups["left_arm"].joints, *groups["right_arm"].joints)


class TestModule:
    @pytest.mark.parametrize("robot", ROBOTS)
    def test_the_module_declares_what_was_guessed(self, robot):
        guessed = guess(robot)
        assert run(guessed.module(), robot) == guessed.descriptor

    @pytest.mark.parametrize("robot", CATALOGUE)
    def test_the_catalogue_could_have_been_written_so(self, robot):
        known = RobotRegistry.load(robot)
        assert run(write_module(known), robot) == known

    @pytest.mark.long
    def test_the_modules_are_formatted(self, tmp_path):
        for robot in ROBOTS:
            (tmp_path / f"{robot}.py").write_text(guess(robot).module(), encoding="utf-8")
        config = f"--config={CHECKOUT / 'pyproject.toml'}"
        for command in (["format", "--check"], ["check", "--ignore=E501"]):
            done = subprocess.run(
                [sys.executable, "-m", "ruff", *command, config, str(tmp_path)],
                capture_output=True,
                text=True,
                check=False,
            )
            assert done.returncode == 0, done.stdout + done.stderr


def run(source: str, robot: str) -> RobotDescriptor:
    scope: dict[str, object] = {}
    exec(source, scope)
    found = scope[robot.upper()]
    assert isinstance(found, RobotDescriptor)
    return found


class TestCommand:
    def test_it_prints_reasons_or_the_module(self, capsys):
        assert main(["robots", "guess", str(urdf_of("so100")), "--name", "tiny"]) == 0
        assert capsys.readouterr().out.splitlines()[-1].endswith(" more reasons: --all")
        assert main(["robots", "guess", str(urdf_of("so100")), "--name", "tiny", "--all"]) == 0
        assert "gripper: one jaw, gripper, the last joint" in capsys.readouterr().out
        assert main(["robots", "guess", str(urdf_of("so100")), "--name", "tiny", "--module"]) == 0
        assert "TINY = RobotDescriptor(" in capsys.readouterr().out

    def test_what_cannot_be_read_is_an_error(self, capsys, tmp_path):
        assert main(["robots", "guess", str(tmp_path / "no.urdf")]) == 1
        assert "error: cannot read the URDF" in capsys.readouterr().err


class TestRobotDescriptions:
    """Names of the package robot_descriptions, which clones repositories; never from here."""

    @pytest.fixture(autouse=True)
    def _no_network(self, monkeypatch):
        """Let git look for every repository in a folder that does not exist."""
        monkeypatch.setenv("GIT_CONFIG_COUNT", "1")
        monkeypatch.setenv("GIT_CONFIG_KEY_0", "url./no/such/folder/.insteadOf")
        monkeypatch.setenv("GIT_CONFIG_VALUE_0", "https://")

    def test_without_the_package_the_command_is_named(self, monkeypatch):
        monkeypatch.setattr("robots.from_urdf.find_spec", lambda name: None)
        with pytest.raises(MissingPackageError, match="no file panda_descr.*pip install robot_d"):
            guess_descriptor("panda_description")

    def test_an_unknown_name_is_told_before_anything_is_cloned(self):
        pytest.importorskip("robot_descriptions")
        with pytest.raises(UnknownNameError, match="Did you mean 'panda_description'"):
            guess_descriptor("panda_descriptio")

    def test_a_repository_that_cannot_be_cloned_is_an_error(self, tmp_path, monkeypatch):
        pytest.importorskip("robot_descriptions")
        monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path))
        monkeypatch.delitem(sys.modules, "robot_descriptions.ur5e_description", raising=False)
        with pytest.raises(AssetError, match="robot_descriptions could not bring ur5e_descr"):
            guess_descriptor("ur5e_description")

    @pytest.mark.long
    def test_a_robot_in_its_cache_is_guessed(self, tmp_path, monkeypatch):
        """A repository of one real URDF, where the package would have cloned the public one."""
        pytest.importorskip("robot_descriptions")
        repository = tmp_path / "SO-ARM100"
        shutil.copytree(urdf_of("so100").parent, repository / "Simulation" / "SO100")
        git = ["git", "-C", str(repository), "-c", "user.name=x", "-c", "user.email=x@localhost"]
        for command in (["init", "-q"], ["add", "-A"], ["commit", "-q", "-m", "one"]):
            subprocess.run([*git, *command], check=True)
        head = subprocess.check_output([*git, "rev-parse", "HEAD"], text=True).strip()
        (tmp_path / f"SO-ARM100-{head}").mkdir()
        repository = repository.rename(tmp_path / f"SO-ARM100-{head}" / "SO-ARM100")
        code = (
            "from robots.from_urdf import guess_descriptor;"
            "robot = guess_descriptor('so_arm100_description', 'mine').descriptor;"
            "print(robot.action_dim, robot.urdf.locate())"
        )
        done = subprocess.run(
            [sys.executable, "-c", code],
            env={
                **os.environ,
                "PYTHONPATH": os.pathsep.join([str(CHECKOUT), *sys.path]),
                "ROBOT_DESCRIPTIONS_CACHE": str(tmp_path),
                "ROBOT_DESCRIPTION_COMMIT": head,
            },
            capture_output=True,
            text=True,
            check=False,
        )
        urdf = repository / "Simulation" / "SO100" / "so100.urdf"
        assert done.stdout == f"6 {urdf}\n", done.stderr


def test_a_guess_can_be_registered_under_its_own_name(monkeypatch):
    monkeypatch.setattr(CATALOGUED, "registered", {})
    mine = RobotDescriptor.from_urdf(urdf_of("koch"), "my_koch", quiet=True)
    assert RobotRegistry.register(replace(mine, reach=0.4)).name == "my_koch"
    assert "my_koch" in RobotRegistry.names()
