"""Skills on joints: what a gripper holds is opened, turned, slid."""

import sys
from math import pi
from pathlib import Path

import numpy as np
import pytest

import tasks
from layouts import single
from objects import ObjectRegistry
from robot_layouts import experts
from tasks import Area, MultiRobotTask, Object, register_task

TUTORIALS = Path(__file__).parents[2] / "docs/tutorials"

# Joint, how far it is to go, and where the thing stands before a Panda whose base is at x = -0.615.
WORKED = {
    "cupboard": ("door", 0.8, Area(x=0.0, y=0.3, yaw=pi)),
    "crank": ("arm", 1.0, Area(x=-0.1)),
    "dial": ("knob", 0.8, Area(x=-0.1)),
    "drawer": ("drawer", 0.15, Area(x=0.0, y=-0.3, yaw=pi)),
    "hinged_box": ("lid", 0.9, Area(x=0.0, y=-0.3, yaw=pi)),
    "latch": ("bolt", 0.05, Area(x=-0.1, yaw=pi / 2)),
    "lever": ("lever", 0.2, Area(x=-0.1)),
    "slider": ("cap", 0.15, Area(x=-0.1, yaw=pi / 2)),
    "tap": ("handle", 1.2, Area(x=-0.1)),
    "valve": ("wheel", 0.8, Area(x=-0.1)),
}


def worked(name):
    """Return a task in which one arm moves a joint of a thing, and its expert's plan of seed 0."""
    joint, to, where = WORKED[name]
    thing = ObjectRegistry.load(name)
    start = thing.joint(joint).start

    class Work(MultiRobotTask):
        """Move the joint."""

        layout = single({"arm": "panda"})
        max_episode_steps = 150
        thing = Object(name, kind="kinematic", spawn=where)

        def evaluate(self, state):
            """Success: it is where it is to be."""
            return {"success": abs(state.joint("thing", joint) - start) > 0.9 * abs(to - start)}

    register_task(f"TestWork_{name}-v1")(Work)
    task = tasks.make(f"TestWork_{name}-v1")

    def on(scene, grip):
        ways = np.linspace(start, to, 5)[1:]
        return [experts.moved_along(scene, "thing", joint, at, grip) for at in ways]

    grips = experts.thing_grips(thing, "thing", 0.08, lean=pi / 2)
    grips = experts.in_reach(task, "arm", grips, on=on)
    script = {
        "arm": [
            *experts.pick("arm", f"thing.{joint}", grips, ready=0.03, around=0.01),
            *experts.move_joint("arm", "thing", joint, to),
        ]
    }
    return task, experts.first_success(task, 0, lambda scene: [script])


@pytest.mark.parametrize("name", ["drawer", "hinged_box"])
def test_a_panda_opens_it(name):
    _, plan = worked(name)
    assert plan.reason == ""


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(set(WORKED) - {"drawer", "hinged_box"}))
def test_a_panda_works_it(name):
    _, plan = worked(name)
    assert plan.reason == ""


@pytest.mark.parametrize("seeds", [range(2), pytest.param(range(2, 20), marks=pytest.mark.long)])
def test_one_arm_opens_a_drawer_and_the_other_puts_a_can_in(seeds, monkeypatch):
    monkeypatch.syspath_prepend(str(TUTORIALS))
    import drawer

    task = tasks.make("PutAway-v1")
    for seed in seeds:
        plan = drawer.put_away(task, seed)
        assert plan.reason == "", seed
        task.reset(seed=seed)
        for action in plan:
            _, _, _, _, info = task.step(action[None])
        assert info["success"].all(), seed
    sys.modules.pop("drawer")


def test_grips_from_which_the_way_is_out_of_reach_are_left_out():
    task, _ = worked("drawer")
    task.reset(seed=0)
    scene = experts.Scene(task)
    thing = ObjectRegistry.load("drawer")
    grips = experts.thing_grips(thing, "thing", 0.08, lean=pi / 2)
    far = experts.in_reach(task, "arm", grips, on=lambda scene, grip: [(grip[0] + 1.0, grip[1])])
    assert experts.in_reach(task, "arm", grips)(scene)
    assert far(scene) == []
