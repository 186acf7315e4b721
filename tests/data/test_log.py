"""A log goes to a package that may be missing; whatever is wrong with it is said before any work.

What the packages write is read back in `tests/clients/programs/logs_program.py`.
"""

import sys

import pytest

from robot_layouts.__main__ import main
from robot_layouts.data.log import opened_log
from robots import MissingPackageError, TaskError, UnknownNameError

WORDS = ["evaluate", "--task", "PushT-v1", "--policy", "tests.data.policies:still", "--workers=0"]


def test_nothing_is_kept_unless_it_is_asked_for():
    with opened_log(None) as log:
        log(1, {"success": 0.5})


@pytest.mark.parametrize(
    ("where", "error", "words"),
    [
        ("tensorbord:runs", UnknownNameError, "Did you mean 'tensorboard'.*tensorboard:DIR or wan"),
        ("", UnknownNameError, "unknown kind of log ''"),
        ("tensorboard", TaskError, "the log 'tensorboard' does not say where; write tensorboard:D"),
        ("wandb:", TaskError, "the log 'wandb:' does not say where"),
    ],
)
def test_a_log_that_is_none(where, error, words):
    with pytest.raises(error, match=words), opened_log(where):
        pass


@pytest.mark.parametrize(
    ("where", "module", "extra"),
    [("tensorboard:runs", "torch.utils.tensorboard", "log"), ("wandb:tests", "wandb", "wandb")],
)
def test_a_package_that_is_missing(where, module, extra, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(MissingPackageError, match=rf"pip install 'robot-layouts\[{extra}\]'"):
        with opened_log(where):
            pass
    assert main([*WORDS, "--log", where]) == 1
    said = capsys.readouterr()
    assert "pip install" in said.err
    assert said.out == ""  # nothing was played
    assert list(tmp_path.iterdir()) == []
