"""``robot-layouts new robot``: a file that declares a robot, and its test."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

from robot_layouts.core.cli import Folder, main_of
from robot_layouts.core.commands import notice, start
from robot_layouts.core.errors import DescriptorError
from robot_layouts.core.writing import check_module_name, write_new
from robots.assets.locator import LocalUrdf
from robots.data_module import write_module
from robots.from_urdf import guess_descriptor
from robots.mjcf.locator import LocalMjcf
from robots.registry import RobotRegistry

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


main = main_of(new_robot, "new robot")

if __name__ == "__main__":
    start(main)
