"""``robot-layouts tasks check``: scores that prove nothing are found out."""

import pytest

import tasks
from layouts import single
from robot_layouts import experts
from robot_layouts.__main__ import main
from robot_layouts.data.gate import check_task
from tasks import Area, CellTask, Cube, Table, register_task


class GateReach(CellTask):
    """Bring the hand near the cube."""

    layout = single({"arm": "panda"})
    max_episode_steps = 80
    stages = {"is_coming": 0.5, "success": 1.0}  # noqa: RUF012
    table = Table()
    cube = Cube(0.02, spawn=Area(x=(0.0, 0.1), y=(-0.25, 0.25)))

    def evaluate(self, state):
        """Success: within 5 cm."""
        way = state.tcp_distance("arm", "cube")
        return {"is_coming": way < 0.12, "success": way < 0.05}

    def ways(self, state):
        """Of the hand to the cube."""
        return [state.tcp_distance("arm", "cube")]


class GateGiven(GateReach):
    """Nothing is left to be done: the cube lies below the hand, and inside the table."""

    cube = Cube(0.02, spawn=Area(x=0.0, y=0.0, z=0.0))

    def evaluate(self, state):
        """Success: always."""
        return {"is_coming": state.full(False), "success": state.full(True)}


def reach(task, seed):
    """Bring the hand over the cube."""

    def over(scene):
        return [(scene.body("cube")[0] + (0.0, 0.0, 0.03), scene.tcp("arm")[1])]

    script = {"arm": [experts.Waypoint("over", over, near=0.0)]}
    return experts.first_success(task, seed, lambda scene: [script])


@pytest.fixture(scope="module", autouse=True)
def registered():
    """Make the tasks known, after other tests have listed all tasks."""
    for cls in (GateReach, GateGiven):
        experts.register_expert(register_task(f"{cls.__name__}-v1")(cls).task_id, reach)


@pytest.mark.long
def test_a_strangers_task_that_is_sound_passes(capsys):
    assert main(["tasks", "check", f"{__name__}:GateReach-v1", "--seeds", "4"]) == 0
    printed = capsys.readouterr().out
    assert "4 of 4" in printed
    assert "its scores are proofs" in printed


@pytest.mark.long
def test_what_proves_nothing_does_not(capsys):
    found = {outcome.check: outcome for outcome in check_task("GateGiven-v1", 2)}
    failed = [check for check, outcome in found.items() if not outcome.passed]
    assert failed == [
        "touches at the start",
        "stages",
        "reward with time",
        "random actions solve",
        "unseeing, solves",
    ]
    assert "cube" in found["touches at the start"].found
    assert found["stages"].found == "2 skipped"
    assert main(["tasks", "check", f"{__name__}:GateGiven-v1", "--seeds", "1"]) == 1
    assert "not yet: touches at the start, stages" in capsys.readouterr().out


def test_a_task_without_an_expert_is_refused(capsys):
    register_task("GateAlone-v1")(type("GateAlone", (GateReach,), {"__doc__": "Reach."}))
    assert "GateAlone-v1" in tasks.list_tasks()
    assert main(["tasks", "check", "GateAlone-v1"]) == 1
    assert "GateAlone-v1 has no expert yet" in capsys.readouterr().err
