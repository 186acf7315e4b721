"""The console script: one tree of commands, which no file of the user's can hide."""

import ast
import os
import re
import subprocess
import sys

import pytest

from robot_layouts.__main__ import PROGRAM, main
from tests.faults.toy_robots import toy
from tests.outside.lab import CHECKOUT, make_folder, run

PYPROJECT = (CHECKOUT / "pyproject.toml").read_text()


def test_it_is_the_console_script():
    assert 'robot-layouts = "robot_layouts.__main__:run"' in PYPROJECT


@pytest.mark.parametrize("words", [[], ["help"], ["--help"]], ids=" ".join)
def test_it_lists_its_commands(capsys, words):
    assert main(words) == 0
    users, developers = capsys.readouterr().out.split("for developers of the library:")
    for printed, commands in ((users, PROGRAM.for_users), (developers, PROGRAM.for_developers)):
        for name, command in commands.items():
            assert re.search(f"^  {name} +{re.escape(command.about)}$", printed, re.MULTILINE)


@pytest.mark.parametrize("name", PROGRAM.commands)
def test_help_begins_with_what_the_command_does(capsys, name):
    with pytest.raises(SystemExit) as stopped:
        main(["help", *name.split()])
    assert stopped.value.code == 0
    printed = capsys.readouterr().out
    assert printed.startswith(f"usage: robot-layouts {name}")
    about = " ".join(printed.partition("\n\n")[2].split())
    assert about.startswith(PROGRAM.commands[name].about)


def test_required_options_come_first_and_say_so(capsys):
    with pytest.raises(SystemExit):
        main(["record", "--help"])
    printed = capsys.readouterr().out
    assert printed.startswith("usage: robot-layouts record [-h] --task TASK --episodes N --out DIR")
    assert printed.count("(required)") == 3


def test_a_group_lists_its_commands(capsys):
    assert main(["robots"]) == 0
    assert "robots inspect" in capsys.readouterr().out
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("robot-layouts 0.")


@pytest.mark.parametrize(
    ("words", "near"),
    [
        (["recrod"], "record"),
        (["robots", "inspekt"], "robots inspect"),
        (["new", "tsk"], "new task"),
        (["task"], "tasks"),
        (["help", "recrod"], "record"),
    ],
)
def test_a_wrong_word_gets_its_closest_match(capsys, words, near):
    assert main(words) == 2
    assert f"Did you mean {near!r}?" in capsys.readouterr().err


@pytest.mark.long
def test_files_of_the_user_hide_nothing_from_it(tmp_path):
    folder = make_folder(tmp_path, shadows=True)
    codes, printed = run(folder, "record --help", "tasks describe --help", "robots inspect panda")
    assert codes == [0, 0, 0], printed
    for usage in ("robot-layouts record", "robot-layouts tasks describe"):
        assert f"usage: {usage} " in printed


def test_a_package_that_hides_ours_is_named(tmp_path):
    folder = make_folder(tmp_path, shadows=True)
    for module, hides in (("layouts", "robots"), ("tasks", None)):
        done = subprocess.run(
            [sys.executable, "-m", module, "--help"],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 1
        if hides is None:  # this one is run itself
            assert "RuntimeError: hidden" in done.stderr
        else:
            theirs = folder / hides / "__init__.py"
            assert f"{theirs} hides the package {hides!r} of robot-layouts" in done.stderr
            assert "commands called as `robot-layouts …` do neither" in done.stderr


class TestNew:
    @pytest.mark.long
    def test_task_writes_files_that_run(self, tmp_path, capsys):
        words = ["new", "task", "two_arm_reach", "--out", str(tmp_path), "--robots"]
        assert main([*words, "left=panda", "right=so100"]) == 0
        assert sorted(path.name for path in tmp_path.iterdir()) == [
            "test_two_arm_reach.py",
            "two_arm_reach.py",
        ]
        source = (tmp_path / "two_arm_reach.py").read_text()
        assert 'layout = face_to_face({"left": "panda", "right": "so100"}, spacing=' in source
        done = self.pytest(tmp_path)
        assert "3 passed" in done.stdout, done.stdout + done.stderr
        (tmp_path / "two_arm_reach.py").unlink()
        assert main([*words, "left=panda", "right=so100"]) == 1
        said = capsys.readouterr().err
        assert "test_two_arm_reach.py is there already, and is not overwritten" in said
        assert not (tmp_path / "two_arm_reach.py").exists()

    def test_no_goal_of_a_task_is_reached_from_the_start(self, tmp_path, monkeypatch):
        from tasks import make

        monkeypatch.syspath_prepend(tmp_path)
        words = ["new", "task", "FarReach", "--out", str(tmp_path), "--robots"]
        assert main([*words, "left=panda", "right=so100"]) == 0
        env = make("far_reach:FarReach-v1", num_envs=8)
        for place in env.layout.places:
            assert env.state.tcp_distance(place, f"goal_{place}").min() > 0.03

    @pytest.mark.long
    @pytest.mark.parametrize(
        "robots",
        [["arm=panda"], ["a=z1", "b=so100", "c=xarm7"], ["a=ur5", "b=panda_stick"]],
        ids=len,
    )
    def test_task_of_any_robots(self, tmp_path, robots):
        assert main(["new", "task", "Reach", "--out", str(tmp_path), "--robots", *robots]) == 0
        assert "3 passed" in self.pytest(tmp_path).stdout

    @pytest.mark.parametrize(
        ("name", "robot", "words"),
        [
            ("9lives", "a=panda", "'9lives' cannot be the name of a task: it is made of letters"),
            ("PickCube", "a=panda", "is a task PickCube-v1 already; choose another name, such as"),
            ("Class", "a=panda", "'class' is a keyword of Python; choose another name"),
            ("Layouts", "a=panda", "'layouts' is a package of this library; choose another name"),
            (
                "Json",
                "a=panda",
                "'json' is a module of Python; choose another name, such as MyJson",
            ),
            ("Torch", "a=panda", "the file would be torch.py, but 'torch' is an installed module"),
            ("Reach", "panda", "'panda' should be PLACE=ROBOT"),
            ("Reach", "a=pandda", "Did you mean 'panda'?"),
            ("Reach", "a=nowhere/arm.urdf", "/nowhere/arm.urdf'. A robot goes by a name"),
            ("../Reach", "a=panda", "'../Reach' cannot be the name of a task"),
        ],
    )
    def test_task_refuses(self, tmp_path, capsys, name, robot, words):
        assert main(["new", "task", name, "--out", str(tmp_path), "--robots", robot]) > 0
        assert words in capsys.readouterr().err
        assert not list(tmp_path.iterdir())

    @pytest.mark.parametrize(
        ("name", "words"),
        [
            ("panda", "is a robot panda already; choose another name, such as --name my_panda"),
            ("Random", "the file would be random.py, but 'random' is a module of Python"),
            ("lambda", "'lambda' is a keyword of Python"),
            ("tasks", "'tasks' is a package of this library"),
        ],
    )
    def test_robot_refuses(self, tmp_path, capsys, name, words):
        urdf = tmp_path / "arm.urdf"
        urdf.write_text(toy())
        assert main(["new", "robot", str(urdf), "--name", name, "--out", str(tmp_path)]) == 1
        assert words in capsys.readouterr().err
        assert list(tmp_path.iterdir()) == [urdf]

    def test_task_of_a_urdf_whose_folder_has_a_quote_in_its_name(self, tmp_path):
        folder = tmp_path / """a"b'c"""
        folder.mkdir()
        (folder / "arm.urdf").write_text(toy())
        words = ["new", "task", "Reach", "--out", str(folder), "--robots", f"arm={folder}/arm.urdf"]
        assert main(words) == 0
        source = ast.parse((folder / "reach.py").read_text())
        texts = [node.value for node in ast.walk(source) if isinstance(node, ast.Constant)]
        assert "arm.urdf" in texts  # beside the file

    def test_task_of_a_urdf_whose_own_name_has_a_quote(self, tmp_path):
        (tmp_path / """a"b'c.urdf""").write_text(toy())
        words = ["new", "task", "Reach", "--out", str(tmp_path), "--robots"]
        assert main([*words, f"""arm={tmp_path}/a"b'c.urdf"""]) == 0
        source = ast.parse((tmp_path / "reach.py").read_text())
        texts = [node.value for node in ast.walk(source) if isinstance(node, ast.Constant)]
        assert """a"b'c.urdf""" in texts

    def pytest(self, folder) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "."],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
            capture_output=True,
            text=True,
            check=False,
        )
