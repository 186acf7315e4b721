"""``robot-layouts tasks elsewhere``: other places for the robots of a task."""

import numpy as np
import pytest

from layouts import Layout, Pose, single
from robot_layouts.__main__ import main
from robot_layouts.data.elsewhere import SPOTS, _most_different, stand_elsewhere
from robot_layouts.data.gate import check_task
from robot_layouts.experts import register_expert
from robots import LayoutError, TaskError
from tasks import MultiRobotTask, register_task


def test_an_arm_has_to_reach_the_poses_that_lie_farthest_apart_where_it_works():
    line = np.zeros((101, 7))
    line[:, 0] = np.linspace(0.0, 1.0, 101)
    line[40:60, 2] = 0.5  # it raises something on its way
    spots = np.array(_most_different(line))
    assert len(spots) == SPOTS
    assert {0.0, 1.0} <= {*spots[:, 0]}
    assert (spots[:, 2] == 0.0).all()
    assert len(_most_different(line[:4])) == 1  # three centimetres are one place
    assert len(_most_different(line[:4], 0.5)) == 2  # for arms half as large they are two


class ElsewhereReach(MultiRobotTask):
    """Be somewhere, and never succeed."""

    layout = single({"arm": "panda"})
    max_episode_steps = 5

    def evaluate(self, state):
        """Success: never."""
        return {"success": state.full(False)}


class ElsewhereStay(ElsewhereReach):
    """Be where the arm begins, if it stands where the task has it."""

    def evaluate(self, state):
        """Success: the hand is before the origin."""
        return {"success": abs(state.tcp_position("arm")[:, 1]) < 0.05}


@pytest.fixture(scope="module", autouse=True)
def registered():
    """Make the tasks known, after other tests have listed all tasks."""
    for task in (ElsewhereReach, ElsewhereStay):
        task_id = register_task(f"{task.__name__}-v1")(task).task_id
        register_expert(task_id, lambda task, seed: np.zeros((2, 8), np.float32))


def test_a_task_that_its_expert_does_not_solve_names_no_places(capsys):
    with pytest.raises(TaskError, match="solves none of 2 episodes"):
        stand_elsewhere("ElsewhereReach-v1", episodes=2)
    assert main(["tasks", "elsewhere", "CellPutAndClos-v1"]) == 2
    assert "CellPutAndClose-v1" in capsys.readouterr().err


@pytest.mark.long
def test_places_from_which_the_expert_solves_nothing_are_refused():
    told: list[str] = []
    with pytest.raises(LayoutError, match="from the places that 3 searches found"):
        stand_elsewhere("ElsewhereStay-v1", episodes=2, tries=1, tell=told.append)
    assert told.count("from the places found, 0 of 0 episodes solved") == 3


@pytest.mark.long
def test_the_expert_solves_the_cell_from_the_places_that_were_found(tmp_path, capsys):
    file = tmp_path / "cell.yaml"
    words = ["tasks", "elsewhere", "CellPutAndClose-v1", "--out", str(file)]
    assert main(words) == 0
    assert f"layout: {file}" in capsys.readouterr().out
    assert Layout.load(file).frame_poses == {"task": Pose()}  # it stays where it is declared
    found = check_task("CellPutAndClose-v1", 3, layout=Layout.load(file))
    assert [one.check for one in found if not one.passed] == []
