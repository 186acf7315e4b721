"""Experts that speak of their task's declaration solve it with robots of other sizes."""

import numpy as np
import pytest

import tasks
from robot_layouts.experts import Waypoint, find_expert, first_success
from robot_layouts.experts.framed import FramedScene
from robot_layouts.experts.script import Scene
from robot_layouts.experts.tips import pose_solver
from tasks.episode import play

WITHOUT_FINGERS = ("CloseDrawers", "SetFaders", "ThrowLevers", "TurnTaps", "HoldAndPush")


def of(cell: str, robot: str) -> tasks.TaskEnv:
    places = tasks.get_task_class(f"Cell{cell}-v1").layout
    robots = dict.fromkeys(places, robot)
    return tasks.make(f"Cell{cell}-v1", robots=robots, obs_mode="none")


def before(scene: Scene, arm: str, height: float) -> np.ndarray:
    """Return a place 45 cm before an arm, on the way to its case, at a height (m)."""
    base, case = scene.base(arm), scene.body(f"case_{arm}")[0]
    return base + 0.45 * (case - base) / np.linalg.norm(case - base) + (0.0, 0.0, height)


@pytest.fixture(scope="module")
def small():
    env = of("CloseDrawers", "so101")
    env.reset(seed=2)
    yield env
    env.close()


def test_a_declared_scene_is_the_state_that_the_task_judges(small):
    world, fit = Scene(small), small.task.fit
    scene = FramedScene(world, fit)
    place, quaternion = scene.in_world(scene.body("case_first.drawer"))
    there, turned = world.body("case_first.drawer")
    assert place == pytest.approx(there, abs=1e-6)
    assert abs(quaternion @ turned) == pytest.approx(1.0, abs=1e-6)
    assert scene.in_world(scene.tcp("second"))[0] == pytest.approx(world.tcp("second")[0], abs=1e-6)
    base = scene.base("third"), np.array([1.0, 0.0, 0.0, 0.0])
    assert scene.in_world(base)[0] == pytest.approx(world.base("third"))
    assert scene.scale("case_first") == pytest.approx(1.0)
    assert (scene.qpos("first") == world.qpos("first")).all()


def test_parts_move_as_far_as_they_are_declared_to(small):
    scene = FramedScene(Scene(small), small.task.fit)
    now = scene.joints("case_first")["drawer"]
    own = tasks.make("CellCloseDrawers-v1", obs_mode="none")
    own.reset(seed=2)
    assert now == pytest.approx(Scene(own).joints("case_first")["drawer"], abs=1e-4)
    here, _ = scene.part("case_first", "drawer", now)
    assert here == pytest.approx(scene.body("case_first.drawer")[0], abs=1e-6)
    shut, _ = scene.part("case_first", "drawer", 0.0)
    assert np.linalg.norm(here - shut) == pytest.approx(now, abs=1e-6)


def test_a_script_as_declared_goes_where_its_numbers_are_in_the_world(small):
    fit, ended = small.task.fit, []

    def above(scene: Scene) -> np.ndarray:
        return before(scene, "first", 0.1)

    def arrived(scene: Scene) -> bool:
        ended.append((scene.tcp("first")[0], above(scene)))
        return False

    point = Waypoint("above", at=above, until=arrived, near=0.02)
    first_success(small, 2, lambda scene: [{"first": [point]}], as_declared=True)
    tip, wanted = ended[-1]
    assert tip == pytest.approx(wanted, abs=0.03)
    world = fit.place(tuple(wanted.tolist()))
    assert world[2] == pytest.approx(0.1 * fit.scale)


CASES = [
    *((cell, "so101") for cell in (*WITHOUT_FINGERS, "PushBar")),
    ("SetFaders", "z1"),
    *((cell, "ur10") for cell in ("PushBar", "TakeSides")),
]


@pytest.mark.parametrize(("cell", "robot"), CASES)
def test_arms_of_other_sizes_solve_cells_that_take_no_fingers(cell: str, robot: str):
    """Arms of five joints, one that leans where it does not reach upright, and some that jump."""
    env = of(cell, robot)
    plan = find_expert(env.task_id)(env, 0)
    assert play(env, 0, plan).solved, plan.reason


def test_an_arm_of_five_joints_turns_its_gripper_as_well_as_it_can(small):
    """From a posture at its side too, and downwards anywhere before it."""
    solver, scene = pose_solver(small, "first"), FramedScene(Scene(small), small.task.fit)
    place = before(scene, "first", 0.1)
    aside = scene.qpos("first")
    aside[0] = 1.5
    for qpos in (scene.qpos("first"), aside):
        pose = scene.in_world((place, np.array([0.0, 1.0, 0.0, 0.0])))
        assert solver.solve(*pose, qpos) is not None
