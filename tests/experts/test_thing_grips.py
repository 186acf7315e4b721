"""Grasps of things as experts use them: an arm lifts what the registry says how to hold."""

import numpy as np
import pytest

import tasks
from layouts import single
from objects import ObjectRegistry
from robot_layouts.experts import CLOSED, Waypoint, first_success, pick, thing_grips
from robots import RobotRegistry, TaskError
from robots.gripper_motion import gripper_motion
from tasks import Area, MultiRobotTask, Object, register_task

HIGH = 0.08  # m


def lifting(name: str, rest: str | None):
    """A task in which a thing is to be lifted by 8 cm."""

    class Lift(MultiRobotTask):
        layout = single({"arm": "panda"})
        max_episode_steps = 100
        thing = Object(name, rest=rest, spawn=Area(x=(-0.1, 0.0), y=(-0.1, 0.1), yaw=(-0.5, 0.5)))

        def evaluate(self, state):
            """Success: it is high and held."""
            high = state.position("thing")[:, 2] > self.thing.height + HIGH
            return {"success": high & state.is_grasping("arm", "thing")}

    task_id = f"TestLift{name.title().replace('_', '')}-v1"
    register_task(task_id)(Lift)
    return tasks.make(task_id)


def script(scene, grips):
    """Take it, and go straight up."""

    def up(scene):
        position, quaternion = scene.tcp("arm")
        return [(position + (0.0, 0.0, 1.5 * HIGH), quaternion)]

    chosen = pick("arm", "thing", grips)
    return {"arm": [*chosen, Waypoint("lift", up, CLOSED)]}


@pytest.mark.parametrize(
    ("name", "rest"),
    [
        ("mug", None),
        ("hammer", None),
        pytest.param("bowl", None, marks=pytest.mark.long),
        pytest.param("peg", "lying", marks=pytest.mark.long),
        pytest.param("brick", None, marks=pytest.mark.long),
        pytest.param("bolt", None, marks=pytest.mark.long),
        pytest.param("box", None, marks=pytest.mark.long),
    ],
)
def test_a_panda_lifts_what_the_registry_says_how_to_hold(name, rest):
    env = lifting(name, rest)
    opening = gripper_motion(RobotRegistry.load("panda")).widest
    assert opening == pytest.approx(0.08, abs=2e-3)
    grips = thing_grips(env.task.thing.descriptor, "thing", opening)
    for seed in (0, 1):
        plan = first_success(env, seed, lambda scene: [script(scene, grips)])
        env.reset(seed=seed)
        solved = [bool(env.step(action[None])[4]["success"][0]) for action in plan]
        assert solved[-1], (seed, plan.reason)


def test_only_steep_grips_that_the_gripper_opens_for_are_offered():
    env = lifting("mug", None)
    env.reset(seed=0)
    mug = ObjectRegistry.load("mug")

    class Upright:
        def body(self, name):
            return np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])

    steep = thing_grips(mug, "thing", 0.08)(Upright())
    assert len(steep) == sum(grasp.part == "rim" for grasp in mug.grasps)
    assert len(thing_grips(mug, "thing", 0.08, lean=np.pi)(Upright())) == len(mug.grasps)
    with pytest.raises(TaskError, match="a gripper that opens 0.04 m holds brick in none of its"):
        thing_grips(ObjectRegistry.load("brick"), "thing", 0.04)
