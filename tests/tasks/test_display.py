"""What a prompt and a notebook show of tasks, scenarios, layouts and robots."""

import re
import sys
from xml.etree import ElementTree

import pytest

import tasks
from layouts import grid, single
from robots import RobotRegistry


@pytest.fixture(scope="module")
def task():
    env = tasks.make("TwoRobotPickCube-v1", num_envs=2, robots={"right": "panda_stick"})
    yield env
    env.close()


def test_a_task_in_a_few_lines(task):
    assert repr(task).splitlines() == [
        "TwoRobotPickCube-v1: 2 environments, 100 steps an episode, 20 per s",
        "  robots       left=panda_wristcam, right=panda_stick",
        "  action       15 numbers: left 0:8, right 8:15",
        "  control      pd_joint_delta_pos",
        "  observation  62 numbers (state)",
        "  reward       normalized_dense",
    ]


def test_a_scenario_shows_what_differs(task):
    layout = "layout=Layout(left=panda_wristcam, right=panda_stick)"
    physics = "physics=PhysicsSettings()"
    assert repr(task.scenario) == f"Scenario({layout}, num_envs=2, {physics})"


def test_a_robot_in_one_line():
    panda = RobotRegistry.load("panda")
    assert repr(panda) == "RobotDescriptor('panda': 9 joints, 8 action numbers, reach 0.855 m)"
    rows = ElementTree.fromstring(f"<div>{panda._repr_html_()}</div>").findall(".//tbody/tr")
    assert [row[1].text for row in rows] == [n.name for n in panda.describe_action()]


def test_notebooks_show_the_picture_from_above(task):
    for thing in (task.layout, task.scenario, task):
        page = ElementTree.fromstring(f"<div>{thing._repr_html_()}</div>")
        texts = "".join(page.itertext())
        assert page.find(".//{http://www.w3.org/2000/svg}svg") is not None
        assert "panda_stick" in texts
        assert "left" in texts
        assert not re.search("<script|onload", thing._repr_html_())


def test_a_layout_that_cannot_be_drawn_is_a_table(monkeypatch):
    many = grid({f"r{i}": "panda_stick" for i in range(65)}, spacing=2.0)
    assert "r64" in many._repr_html_()
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    drawn = single({"arm": "panda"})._repr_html_()
    assert drawn.startswith("<pre>1 robot, 8 action numbers\n")
