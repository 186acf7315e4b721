"""The declaration: what it takes and refuses, how it is written, how it is told and stored."""

import copy
import json
import pickle

import pytest

import tasks
from robots import TaskError, UnknownNameError
from tasks import LogUniform, MultiRobotTask, Randomization, Uniform

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


@pytest.mark.parametrize("name", ["cub", "arm.panda_hnd", "*.x*", "b*"])
def test_a_name_that_means_nothing_is_refused_when_the_task_is_made(name: str) -> None:
    with pytest.raises(UnknownNameError, match="unknown target of mass"):
        tasks.make("PickCube-v1", randomization=Randomization(mass={name: Uniform(1, 2)}))


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
