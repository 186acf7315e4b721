"""What every task of the catalogue says about itself."""

import pytest

import tasks
from tasks.description import read_docstring
from tasks.registry import CATALOGUE


@pytest.mark.parametrize("task_id", tasks.list_clones())
def test_every_clone_names_its_source(task_id: str):
    source = tasks.get_task_class(task_id).source
    assert source.startswith("mani_skill 3.0.1, envs/tasks/")
    assert source.endswith(".py")


@pytest.mark.parametrize("task_id", CATALOGUE)
def test_every_task_says_what_is_drawn_and_when_it_succeeds(task_id: str):
    cls = tasks.get_task_class(task_id)
    assert "Success:" in cls.__dict__["__doc__"]
    said = read_docstring(cls)
    assert all((said.summary, said.randomization, said.success))
