"""A command line is what a function's signature and docstring say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import pytest

from robot_layouts.__main__ import PROGRAM
from robot_layouts.core.cli import Command, Count, Program, Word
from robot_layouts.core.commands import UsageError
from robots import UnknownNameError


@dataclass(frozen=True, kw_only=True)
class Place:
    """Where.

    Attributes:
        what: What stands there.
        height: How high (m).
    """

    what: str = field(default="table", kw_only=False)
    height: float = 0.5


@dataclass(frozen=True, kw_only=True)
class LitPlace(Place):
    """Where, and how bright.

    Attributes:
        light: How bright (100 % is usual).
    """

    light: int | None = None


def lift(
    arm: Annotated[str, Word("ARM", about="left or right")],
    place: LitPlace,
    cubes: Sequence[Count] = (),
    *,
    out: Path,
    speed: Literal["slow", "fast"] = "slow",
    from_: tuple[float, float] | None = None,
    goal: Annotated[Sequence[str], Word("X,Y", action="append")] = (),
    names: Sequence[str] = (),
    dry: bool = False,
    visuals: bool = True,
) -> int:
    """Lift cubes
    off a table.

    Exit code: 3.

    Args:
        arm: Which arm.
        place: Not shown.
        cubes: Which cubes.
        out: Where the ``log`` goes,
            whatever happens.
        speed: How fast.
        from_: Where to begin.
        goal: Where to; may be given again.
        names: What the cubes are called.
        dry: Move nothing.
        visuals: Draw nothing.
    """
    if dry and names:
        raise UsageError("--dry and --names contradict each other")
    return 3


LAB = Program("lab", {"lift": Command(lift), "cube drop": Command(lift)})


@pytest.mark.parametrize(
    ("words", "arguments"),
    [
        ("left --out o", {"arm": "left", "place": LitPlace(), "out": Path("o")}),
        (
            "left shelf 1 2 --height -1 --light 3 --out o",
            {
                "arm": "left",
                "place": LitPlace("shelf", height=-1.0, light=3),
                "cubes": (1, 2),
                "out": Path("o"),
            },
        ),
        (
            "a --out o --speed fast --from -1 2 --goal 1,2 --goal 3,4 --names x y --no-visuals",
            {
                "arm": "a",
                "place": LitPlace(),
                "out": Path("o"),
                "speed": "fast",
                "from_": (-1.0, 2.0),
                "goal": ("1,2", "3,4"),
                "names": ("x", "y"),
                "visuals": False,
            },
        ),
    ],
)
def test_words_become_arguments(words, arguments):
    assert LAB.parse(["lift", *words.split()]).arguments == arguments


def test_help_is_the_docstring(capsys):
    assert LAB.main(["--help"]) == 0
    assert "lift       Lift cubes off a table.\n" in capsys.readouterr().out
    with pytest.raises(SystemExit, match="0"):
        LAB.main(["help", "lift"])
    printed = " ".join(capsys.readouterr().out.split())
    for text in (
        "usage: lab lift [-h] [--height X] [--light N] --out OUT",
        "Lift cubes off a table.",
        "ARM Which arm: left or right",
        "--out OUT Where the `log` goes, whatever happens (required)",
        "--height X How high (m) (default: 0.5)",
        "--light N How bright (100 % is usual)",
        "--goal X,Y Where to; may be given again",
        "--no-visuals Draw nothing",
        "Exit code: 3.",
    ):
        assert text in printed


@pytest.mark.parametrize(
    ("words", "error"),
    [
        ("", "the following arguments are required: ARM, --out"),
        ("a --out o --namse x", "unrecognized arguments: --namse x. Did you mean --names?"),
        ("a t 0 --out o", "argument N: 0 is too few; it must be 1 or more"),
        ("a t x --out o", "argument N: 'x' is not a whole number"),
        ("a --out o --height x", "argument --height: 'x' is not a number"),
        ("a --out o --speed quick", "argument --speed: invalid choice: 'quick'"),
    ],
)
def test_wrong_words_are_refused(capsys, words, error):
    with pytest.raises(SystemExit, match="2"):
        LAB.main(["lift", *words.split()])
    assert f"lab lift: error: {error}" in capsys.readouterr().err


def test_options_that_contradict_each_other_are_wrong_usage(capsys):
    assert LAB.main("lift a --out o".split()) == 3
    assert LAB.main("lift a --out o --dry --names x".split()) == 2
    assert capsys.readouterr().err == "error: --dry and --names contradict each other\n"


def test_a_group_and_its_closest_match(capsys):
    assert LAB.main(["cube"]) == 0
    assert capsys.readouterr().out.splitlines()[2:] == ["  cube drop  Lift cubes off a table."]
    with pytest.raises(UnknownNameError, match="Did you mean 'cube drop'"):
        LAB.parse(["cube", "drup"])


@pytest.mark.parametrize("name", PROGRAM.commands)
def test_every_word_and_option_of_a_command_has_a_help(name):
    parser = PROGRAM.commands[name].parser(name)
    assert [action.dest for action in parser._actions if not action.help] == []
