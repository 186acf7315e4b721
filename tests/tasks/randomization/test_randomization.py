"""The declaration: what it takes and refuses, how it is written, how it is told and stored."""

import copy
import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import tasks
from robots import TaskError, UnknownNameError
from tasks import Fixed, LogUniform, MultiRobotTask, Normal, Randomization, Shift, Uniform, Whole

MASS = Randomization(mass={"cube": LogUniform(0.5, 2.0), "arm.*": Uniform(0.9, 1.1)})


def test_it_goes_through_json_and_pickle() -> None:
    assert Randomization.from_json(json.loads(json.dumps(MASS.to_json()))) == MASS
    assert pickle.loads(pickle.dumps(MASS)) == copy.deepcopy(MASS) == MASS


def test_it_says_what_varies() -> None:
    assert str(MASS) == "mass cube: log uniform 0.5 … 2\nmass arm.*: uniform 0.9 … 1.1"
    assert (bool(MASS), bool(Randomization())) == (True, False)


def test_numbers_and_plain_data_are_distributions_too() -> None:
    assert Randomization(mass={"cube": 2}) == Randomization(mass={"cube": tasks.Fixed(2.0)})  # type: ignore[dict-item]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"mass": {"cube": {"uniform": [-1, 2]}}}, "mass of 'cube' may be -1 … 2.*within 0.001"),
        ({"mass": {"cube": {"normal": {"std": 1}}}}, "mass of 'cube' may be -inf … inf"),
        ({"mass": {"uniform": [1, 2]}}, "mass of 'uniform' is"),
        ({"mass": {3: 1.0}}, "names are texts"),
        ({"mass": 3.0}, "it takes what is drawn by name"),
        ([], "given by axis"),
    ],
)
def test_what_makes_no_sense_is_refused_when_it_is_declared(data: object, message: str) -> None:
    with pytest.raises(TaskError, match=message):
        Randomization.from_json(data)


def test_the_closest_axis_is_named() -> None:
    with pytest.raises(UnknownNameError, match="unknown axis .* 'mas'. Did you mean 'mass'"):
        Randomization.from_json({"mas": {}})


def test_only_a_randomization_is_one() -> None:
    with pytest.raises(TaskError, match="a tasks.Randomization or None is needed"):
        tasks.make("PickCube-v1", randomization={"mass": {}})  # type: ignore[arg-type]


def test_a_class_may_declare_one() -> None:
    base = tasks.get_task_class("PickCube-v1")
    varied: type[MultiRobotTask] = type("Varied", (base,), {"randomization": MASS})
    assert varied.scenario.randomization == MASS
    wrong: type[MultiRobotTask] = type("Wrong", (base,), {"randomization": "mass"})
    with pytest.raises(TaskError, match=r"Wrong\.randomization is 'mass'"):
        wrong(wrong.scenario)


TEXT = """\
# what varies
mass:
  cube: {log_uniform: [0.5, 2]}
bases:
  "*": {x: {uniform: [-2e-2, 0.02]}, yaw: {normal: {std: 0.02, low: -0.05, high: 0.05}}}
gravity: 9.81
action_delay: 1
"""


@pytest.mark.parametrize("name", ["it.yaml", "it.json"])
def test_it_is_read_from_files_and_written(tmp_path: Path, name: str) -> None:
    (tmp_path / "given.yaml").write_text(TEXT)
    declared = Randomization(
        mass={"cube": LogUniform(0.5, 2.0)},
        bases={"*": Shift(x=Uniform(-0.02, 0.02), yaw=Normal(0.02, low=-0.05, high=0.05))},
        gravity=Fixed(9.81),
        action_delay=Whole(1, 1),
    )
    found = Randomization.load(tmp_path / "given.yaml")
    assert found == declared
    assert Randomization.load(found.save(tmp_path / name)) == declared


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mass: {cube: {unifrm: [1, 2]}}", "it.yaml: .*Did you mean 'uniform'"),
        ("mas: {}", "it.yaml: .*Did you mean 'mass'"),
        ("mass: {cube: 1, cube: 2}", "it.yaml, line 1: 'cube' is there twice"),
        ("mass:\n  cube: [1", "it.yaml, line 2"),
        ("mass: &all {cube: 1}\nfriction: *all", "line 2: aliases"),
        ("- mass", "given by axis"),
        ("mass: {cube: .nan}", "mass of 'cube' is '.nan'"),
        ("mass: {cube: -1}", "within 0.001"),
        ("[" * 5000, "this is nested too deeply"),
        ("!!python/object:os.system {}", "line 1: tags"),
    ],
)
def test_a_file_that_makes_no_sense_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "it.yaml").write_text(text)
    with pytest.raises(TaskError, match=message):
        Randomization.load(tmp_path / "it.yaml")


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TaskError, match="cannot read the randomization"):
        Randomization.load(tmp_path / "none.yaml")


def test_bounds_of_every_axis() -> None:
    for wrong in (
        {"friction": {"cube": Uniform(-0.1, 1)}},
        {"size": {"cube": Fixed(0.0)}},
        {"stiffness": {"arm": Normal(0.1, 1.0)}},
        {"gravity": Uniform(-9.81, 9.81)},
        {"bases": {"arm": {"z": Uniform(0, 1000)}}},
        {"action_delay": Uniform(0, 2)},
        {"observation_delay": Whole(-1, 2)},
    ):
        (axis,) = wrong
        with pytest.raises(TaskError, match=axis if axis != "bases" else "Shift: z"):
            Randomization.from_json(wrong)


@pytest.mark.parametrize(
    ("declared", "closest"),
    [
        *(({"mass": {name: 2.0}}, "unknown target of mass") for name in ("arm.panda_hnd", "*.x*")),
        ({"bases": {"left": {"x": 0.1}}}, "arm"),
        ({"size": {"table-workspace": 2.0}}, "cube"),
        ({"stiffness": {"arm.panda_joint": 2.0}}, "arm.panda_joint"),
        ({"action_noise": {"arm.griper": 0.1}}, "arm.gripper"),
        ({"sensor_noise": {"arm.qps": 0.1}}, "arm.qpos"),
    ],
)
def test_the_closest_target_is_named(declared: dict[str, object], closest: str) -> None:
    with pytest.raises(UnknownNameError) as refused:
        tasks.make("PickCube-v1", randomization=Randomization.from_json(declared))
    assert closest in str(refused.value)


def test_every_front_passes_it_on() -> None:
    import gymnasium

    randomization = Randomization(mass={"cube": LogUniform(0.5, 2.0)})
    expected = tasks.make("PickCube-v1", randomization=randomization)
    expected.reset(seed=5)
    drawn = expected.drawn()
    assert drawn is not None
    mass = pytest.approx(drawn["mass"]["cube"])
    single = gymnasium.make("RobotLayouts/PickCube-v1", randomization=randomization)
    assert float(single.reset(seed=5)[1]["drawn/mass/cube"]) == mass
    single.close()
    many = gymnasium.make_vec(
        "RobotLayouts/PickCube-v1", num_envs=2, randomization=randomization, num_workers=0
    )
    assert float(many.reset(seed=5)[1]["drawn/mass/cube"][0]) == mass
    many.close()
    agents = tasks.parallel_env("PickCube-v1", randomization=randomization)
    assert float(agents.reset(seed=5)[1]["arm"]["drawn/mass/cube"]) == mass
    agents.close()


def test_columns_of_datasets_take_no_noise() -> None:
    noise = Randomization(sensor_noise={"arm.qpos": Normal(0.01)})
    with pytest.raises(TaskError, match="sensor_noise is not added to obs_mode 'lerobot'"):
        tasks.make("PickCube-v1", randomization=noise, obs_mode="lerobot")


def test_a_task_may_draw_noise_when_it_observes() -> None:
    """It is a function of the episode, the step and the name, whatever was done before."""
    env, other = tasks.make("PickCube-v1", 2), tasks.make("PickCube-v1")
    still = np.zeros((1, 8), np.float32)

    def drawn(seed: int, steps: int, name: str = "goal") -> NDArray[np.float32]:
        other.reset(seed=seed)
        for _ in range(steps):
            other.step(still)
        return other.noise(name, 3)[0]

    env.reset(seed=6)
    env.step(np.zeros((2, 8), np.float32))
    found = env.noise("goal", 3)
    np.testing.assert_array_equal(found, [drawn(6, 1), drawn(7, 1)])
    others = [drawn(6, 2), drawn(7, 0), drawn(6, 1, "cube"), drawn(8, 1)]
    assert all((found[0] != row).all() for row in others)
    many = np.concatenate([drawn(seed, 0) for seed in range(100)])
    assert abs(many.mean()) < 0.25
    assert abs(many.std() - 1) < 0.15
