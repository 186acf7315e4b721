import copy
import dataclasses
import inspect
import pickle
import re

import pytest
import torch
from torch import Tensor

import tasks
from layouts import Layout, Placement, single
from robot_layouts.simulation import Friction, PhysicsSettings, State, World
from robot_layouts.simulation.sapien3.backend import worlds_below
from robots import UnknownNameError
from tasks.engine.scenario import ScenarioFields
from tasks.registry import TASKS, make_scenario

SHORT = {"FMBAssembly1Easy-v1": "fmb_assembly"}  # names that do not follow from the id


@pytest.mark.parametrize("task_id", tasks.list_clones())
def test_every_clone_has_its_id_and_its_native_name(task_id: str):
    cls = tasks.get_task_class(task_id)
    assert cls.task_id == cls.native_id == task_id
    assert cls.source.startswith("mani_skill ")
    assert tasks.get_task_class(task_id.lower()) is cls
    snake = SHORT.get(task_id) or re.sub("(?<=[a-z0-9])(?=[A-Z])", "_", task_id[:-3]).lower()
    assert tasks.get_task_class(f"maniskill.{snake}_native") is cls
    assert tasks.get_task_class(f"ManiSkill.{snake.upper()}_native") is cls


def test_a_task_of_our_own_has_no_native_counterpart():
    own = set(tasks.list_tasks()) - set(tasks.list_clones())
    assert own
    for cls in map(tasks.get_task_class, own):
        assert cls.native_id is None
        assert "mani_skill" not in cls.source


def test_a_scenario_is_fresh_at_every_access():
    cls = tasks.get_task_class("PickCube-v1")
    cls.scenario.num_envs = 7
    assert cls.scenario.num_envs == 1
    assert cls.scenario is not cls.scenario


def test_the_metasim_road():
    cls = tasks.get_task_class("maniskill.pick_cube_native")
    assert tasks.get_task_class("pick_cube_native") is cls
    scenario = copy.deepcopy(cls.scenario)
    scenario.num_envs = 1
    scenario.headless = True
    scenario.cameras = []
    scenario.simulator = "sapien3"
    env = cls(scenario)
    assert env.reset(seed=0)[0].shape == (1, 42)
    assert env.scenario is scenario


def test_an_unknown_field_raises():
    scenario = tasks.get_task_class("PickCube-v1").scenario
    with pytest.raises(AttributeError, match="Did you mean 'num_envs'"):
        scenario.num_env = 3
    with pytest.raises(KeyError, match="unexpected keyword argument 'num_environments'"):
        tasks.make("PickCube-v1", num_environments=3)


def test_all_places_take_a_bare_name():
    for task in ("PickCube-v1", "TwoRobotPickCube-v1"):
        placed = tasks.make(task, robots="panda_wristcam").layout.values()
        assert {placement.robot.name for placement in placed} == {"panda_wristcam"}
    with pytest.raises(UnknownNameError, match="robot of this layout 'middle'"):
        tasks.make("TwoRobotPickCube-v1", robots={"middle": "panda"})
    with pytest.raises(UnknownNameError, match="Did you mean 'panda'"):
        tasks.make("PickCube-v1", robots="pnda")


def test_a_robot_without_the_keyframe_starts_from_its_home():
    assert tasks.make("PushT-v1").layout["arm"].start_keyframe == "push_start"
    assert tasks.make("PushT-v1", robots="panda").layout["arm"].start_keyframe == "rest"
    given = single({"arm": "panda"}, keyframe="rest")
    with pytest.raises(UnknownNameError, match="keyframe of panda 'push_start'"):
        single({"arm": "panda_stick"}, keyframe="push_start").replace_robots(arm="panda")
    assert tasks.make("PickCube-v1", layout=given).layout == given


class Still(tasks.MultiRobotTask):
    """A task with nothing in it. Success: never."""

    layout = single({"arm": "panda"})
    max_episode_steps = 3

    def build(self, world: World) -> None:
        """Add nothing."""

    def sample(self, world: World, rng: tasks.EpisodeRandom) -> None:
        """Place nothing."""

    def evaluate(self, state: State) -> dict[str, Tensor]:
        """Never succeed."""
        return {"success": torch.zeros(state.num_envs, dtype=torch.bool)}


def test_a_user_can_declare_a_task(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(TASKS, "registered", dict(TASKS.registered))
    monkeypatch.setattr(TASKS, "aliases", dict(TASKS.aliases))
    tasks.register_task("Still-v0", "test.still")(Still)
    env = tasks.make("test.STILL", num_envs=2)
    assert "Still-v0" in tasks.list_tasks()
    assert env.reward_modes == ("sparse", "none")
    assert env.scenario.physics is None
    obs, info = env.reset(seed=0)
    assert obs.shape == (2, 18)
    assert set(info) == {"elapsed_steps", "success", "reconfigure"}
    truncations = [env.step(torch.zeros(2, 8))[3].tolist() for _ in range(4)]
    assert truncations == [[False] * 2, [False] * 2, [True] * 2, [True] * 2]


def test_without_physics_sapiens_own_defaults_hold_whatever_was_built_before():
    import sapien.physx as physx

    def shape_of(scenario: tasks.Scenario):
        link = worlds_below(Still(scenario).simulation)[0].robots["arm"].link("panda_link1")
        return link.collision_shapes[0]

    tasks.make("PickCube-v1")  # writes ManiSkill's settings into the process
    scenario = Still.scenario
    assert scenario.physics is None
    default = shape_of(scenario)
    assert default.contact_offset == physx.PhysxShapeConfig().contact_offset
    assert default.physical_material.restitution == pytest.approx(0.1)
    scenario.physics = PhysicsSettings(contact_offset=0.03, friction=Friction(0.5, 0.4, 0.2))
    chosen = shape_of(scenario)
    assert chosen.contact_offset == pytest.approx(0.03)
    assert chosen.physical_material.static_friction == pytest.approx(0.5)


def test_errors_and_scenarios_travel_between_processes():
    with pytest.raises(UnknownNameError) as caught:
        tasks.get_task_class("Pick")
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    scenario = tasks.get_task_class("TwoRobotPickCube-v1").scenario
    assert pickle.loads(pickle.dumps(scenario)) == scenario


def test_type_checkers_know_every_keyword():
    """Those that `make` has by itself, and those of a scenario, are all that there are."""
    named = set(inspect.signature(tasks.make).parameters) - {"task_id", "robots", "fields"}
    fields = {field.name for field in dataclasses.fields(tasks.Scenario)}
    assert named | set(ScenarioFields.__annotations__) == fields


def test_a_robot_without_a_place_of_its_own_stands_where_it_reaches():
    """At the origin it would stand on the cube."""
    for name, nearest in (("ur5", -0.8), ("ur10", -1.1), ("panda", -0.615)):
        layout = make_scenario(tasks.get_task_class("PickCube-v1"), robots={"arm": name}).layout
        x, y, z = layout["arm"].base_position
        assert nearest <= x <= nearest + 0.15
        assert (y, z) == (0.0, 0.0)
    there = Layout({"arm": Placement("ur5", position=(0.0, 0.0, 0.0))})
    assert make_scenario(tasks.get_task_class("PickCube-v1"), layout=there).layout[
        "arm"
    ].base_position == (0.0, 0.0, 0.0)
