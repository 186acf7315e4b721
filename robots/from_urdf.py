"""``robot-layouts robots guess`` and ``new robot``: a descriptor of a URDF or MJCF, or a module."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

from robot_layouts.core.cli import Folder, Word
from robot_layouts.core.commands import notice
from robot_layouts.core.errors import (
    AssetError,
    DescriptorError,
    MissingPackageError,
    UnknownNameError,
)
from robot_layouts.core.paths import absolute
from robot_layouts.core.writing import check_module_name, write_new
from robots.assets.locator import LocalUrdf
from robots.data_module import write_module
from robots.guess import Guess, guess
from robots.guessing.hints import NOTHING, Hints, hints_of
from robots.mjcf.locator import LocalMjcf, is_mjcf
from robots.registry import RobotRegistry
from robots.urdf.cleaning.xacro_files import template_of, with_arguments
from robots.urdf.reading import model_of
from robots.urdf.srdf import read_semantics

__all__ = ["Guess", "guess_descriptor"]

URDF, MJCF = "urdf", "mjcf"  # as robot_descriptions has them, too
_REGISTERED = """
RobotRegistry.register({constant})  # from here on, it goes by its name: {name!r}
"""
_TEST = '''"""Tests whether {name} stands and moves as it should; run it with pytest, here."""

from layouts import single
from robots import RobotRegistry
from robot_layouts.simulation.checks.grasp import try_grasps
from robot_layouts.simulation.checks.tcp_control import try_tcp_control
from robot_layouts.simulation.checks.trial import try_robot
from {module} import {constant}


def test_it_goes_by_its_name():
    assert RobotRegistry.load({name!r}) == {constant}


def test_nothing_collides_where_it_stands():
    report = single({{"arm": {constant}}}).validate(workspaces=False)
    assert report.ok, str(report)


def test_every_action_number_moves_its_own_joints():
    assert not try_robot({constant}).problems


def test_its_tcp_goes_where_it_is_sent():
    if {constant}.arm_joints:
        assert [seen.problem for seen in try_tcp_control({constant}) if seen.problem] == []


def test_its_fingers_meet_at_the_tcp_and_hold_a_cube():
    assert [seen.problem for seen in try_grasps({constant}) if seen.problem] == []
'''


def guess_descriptor(
    path_or_name: str | os.PathLike[str],
    name: str | None = None,
    *,
    form: str | None = None,
    xacro: Mapping[str, object] | None = None,
    srdf: str | os.PathLike[str] | None = None,
    folder: str | os.PathLike[str] | None = None,
    **overrides: Any,
) -> Guess:
    """Guess a robot's descriptor from its URDF or its MJCF; nothing is fetched for a path.

    Args:
        path_or_name: A URDF or an MJCF on this machine, or a name of the package
            robot_descriptions, which clones the robot's repository if it has not before. A xacro
            template will do, if the package xacro is installed.
        name: Registry name; None takes that of the URDF or MJCF.
        form: ``"urdf"`` or ``"mjcf"``; None goes by the ending, ``.xml`` and ``.mjcf`` for an MJCF.
        xacro: Arguments of the template, as in ``{"prefix": "left_"}``.
        srdf: An SRDF, whose groups are the arms and grippers, whose chains end in TCPs, and whose
            states and disabled pairs are taken over. None takes disabled pairs of one beside the
            URDF that is called as it, and nothing else.
        folder: A folder whose files may be read, too, such as that of a package which lies
            neither around nor beside the file.
        **overrides: Fields of `robots.RobotDescriptor` that are known better than guessed.
            ``limbs={"left": "1"}`` calls the guessed limb 1 so; limbs that are left out are held.

    Returns:
        The guess: ``.descriptor``, ``.reasons``, and ``.module()``, the data module to paste.

    Raises:
        AssetError: If the file or a mesh of it is missing, or it describes no robot.
        DescriptorError: If nothing moves, or an override contradicts the rest.
        MissingPackageError: If a name is given and robot_descriptions is not installed, a template
            and xacro is not, or an MJCF and MuJoCo is not.
        UnknownNameError: If robot_descriptions has no robot of that name, or the SRDF names a
            group, link or joint that does not exist.
    """
    path = _find(path_or_name, form)
    opened = None if folder is None else str(absolute(folder, "folder"))
    if form == MJCF or (form is None and is_mjcf(path)):
        if xacro or srdf:
            what = "arguments of xacro" if xacro else "SRDF"
            raise DescriptorError(f"{path} is an MJCF, which takes no {what}")
        from robots.mjcf.conversion import convert

        mjcf = LocalMjcf(str(path), opened)
        mjcf.locate()
        return guess(mjcf, name, overrides, file=path, hints=convert(path).hints)
    source = LocalUrdf(str(with_arguments(path, xacro or {})), opened)
    return guess(source, name, overrides, hints=_semantics(source, srdf) if srdf else NOTHING)


def _semantics(source: LocalUrdf, srdf: str | os.PathLike[str]) -> Hints:
    """Return what an SRDF makes known of the robot of a URDF."""
    file = absolute(srdf, "the path of the SRDF")
    return hints_of(read_semantics(file, model_of(source.locate())), file.name)


def _argument(text: str) -> tuple[str, str]:
    key, equals, value = text.partition("=")
    if not key or not equals:
        raise ValueError(f"{text!r} is not KEY=VALUE, such as prefix=left_")
    return key, value


def print_guess(
    urdf: Annotated[str, Word("PATH")],
    *,
    name: str | None = None,
    module: bool = False,
    xacro: Annotated[Sequence[tuple[str, str]], Word("KEY=VALUE", _argument, action="append")] = (),
    srdf: Annotated[str, Word("FILE")] | None = None,
    folder: Folder | None = None,
    all: bool = False,
) -> None:
    """Guess a robot's descriptor from its URDF or MJCF, and say what weakens it.

    Args:
        urdf: A URDF or an MJCF (.xml) on this machine, or a name of the package
            robot_descriptions, such as panda_description or panda_mj_description.
        name: Registry name of the robot (the name in its file).
        module: Print the data module to paste.
        xacro: Argument of a xacro template; may be given again.
        srdf: SRDF with the robot's groups, states and disabled pairs.
        folder: Folder whose files may be read, too, such as that of a package elsewhere.
        all: Say all that was guessed, and why.

    Raises:
        RobotLayoutsError: If the file is unusable, or there is no robot of that name.
    """
    found = guess_descriptor(urdf, name, xacro=dict(xacro), srdf=srdf, folder=folder)
    print(found.module().rstrip("\n") if module else found if all else found.summary())


def _find(path_or_name: str | os.PathLike[str], form: str | None) -> Path:
    """Return the path, or what robot_descriptions has of that name."""
    path = absolute(path_or_name, f"the path of the {(form or URDF).upper()}")
    path = Path(os.path.normpath(path))
    is_name = isinstance(path_or_name, str) and path_or_name.isidentifier()
    if os.path.exists(template_of(path)[0]) or not is_name:
        return path
    return _described(str(path_or_name), form)


def _described(name: str, form: str | None) -> Path:
    if find_spec("robot_descriptions") is None:
        raise MissingPackageError(
            f"there is no file {name}; names of robots are looked up in the package"
            " robot_descriptions, which is not installed: pip install robot_descriptions"
        )
    catalogue: Any = import_module("robot_descriptions._descriptions").DESCRIPTIONS
    forms = (form,) if form else (URDF, MJCF)
    has = {
        key: [f for f in forms if getattr(about, f"has_{f}")] for key, about in catalogue.items()
    }
    known = [key for key, found in has.items() if found]
    if name not in known:
        hint = "`robot_descriptions list` has all."
        what = " or ".join(f"{'an' if f == MJCF else 'a'} {f.upper()}" for f in forms)
        raise UnknownNameError(f"robot of robot_descriptions with {what}", name, known, hint)
    try:
        with redirect_stdout(sys.stderr):  # clones, or finds its clone, and talks about it
            module: Any = import_module(f"robot_descriptions.{name}")
    except Exception as error:  # git's own errors, of a package that need not be installed here
        raise AssetError(f"robot_descriptions could not bring {name}: {error}") from error
    path = getattr(module, f"{has[name][0].upper()}_PATH", None)
    if path is None:
        raise AssetError(f"{name} of robot_descriptions is a xacro template, not a URDF")
    return Path(path)


def new_robot(
    urdf: str, *, name: str | None = None, out: Folder = Path(), folder: Folder | None = None
) -> None:
    """Write the file of a new robot from its URDF, and a test.

    Args:
        urdf: URDF or MJCF, or name in robot_descriptions.
        name: Name of the robot (the name in its URDF).
        out: Folder of the files.
        folder: Folder whose files may be read, too, such as that of a package elsewhere.

    Raises:
        RobotLayoutsError: If the URDF is unusable, or a file is there already.
    """
    found = guess_descriptor(urdf, name, folder=folder)
    name = found.descriptor.name
    module, constant = name.lower(), name.upper()
    better = f"--name my_{module}"
    if name in RobotRegistry.names():
        words = f"there is a robot {name} already; choose another name, such as {better}"
        raise DescriptorError(words)
    check_module_name(module, better, DescriptorError)
    robot = replace(found.descriptor, urdf=_seen_from(out, found.descriptor.urdf))
    source = write_module(robot, found.reasons, also=["RobotRegistry"])
    declared = source + _REGISTERED.format(constant=constant, name=name)
    test = _TEST.format(module=module, constant=constant, name=name)
    for path in write_new(out, {f"{module}.py": declared, f"test_{module}.py": test}):
        print(path)
    notice(
        f"The comments in {module}.py say what was guessed: correct it, and delete them. Test it:"
        f" python -m pytest {out / f'test_{module}.py'}\n"
        f"In {out.absolute()} it goes wherever a robot goes, as {module}:{constant}"
    )


def _seen_from(folder: Path, source: Any) -> LocalUrdf | LocalMjcf:
    """Return where a user's file is, with its paths relative to a folder."""
    given = {"path": source.path, "folder": source.folder}
    start = folder.absolute()
    return replace(source, **{k: Path(os.path.relpath(p, start)) for k, p in given.items() if p})
