"""``robot-layouts new robot``: a file that declares a robot, and its test."""

from __future__ import annotations

import argparse
from pathlib import Path

from robots.common.commands import notice, start
from robots.common.console import main_of
from robots.common.new_files import write_new
from robots.from_urdf import guess_descriptor

_REGISTERED = """
RobotRegistry.register({constant})  # from here on, it goes by its name: {name!r}
"""

_TEST = '''"""Looks whether {name} stands and moves as it is to; run it with pytest, here."""

from layouts import single
from robots import RobotRegistry
from simulation.trial import try_robot
from {module} import {constant}


def test_it_goes_by_its_name():
    assert RobotRegistry.load({name!r}) == {constant}


def test_nothing_collides_where_it_stands():
    report = single({{"arm": {constant}}}).validate(workspaces=False)
    assert report.ok, str(report)


def test_every_action_number_moves_its_own_joints():
    assert not try_robot({constant}).problems
'''


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("urdf", metavar="URDF", help="URDF or MJCF, or name in robot_descriptions")
    parser.add_argument("--name", help="name of the robot (the name in its URDF)")
    parser.add_argument(
        "--out", type=Path, default=Path(), metavar="DIR", help="folder of the files (this one)"
    )


def run(options: argparse.Namespace) -> int:
    """Guess a robot from its URDF, and write its file and its test; returns 0.

    Raises:
        RobotLayoutsError: If the URDF is unusable, or a file is there already.
    """
    found = guess_descriptor(options.urdf, options.name)
    name = found.descriptor.name
    module, constant = name.lower(), name.upper()
    first, _, rest = found.module().partition("\n\nfrom ")
    source = f"{first}\n\nfrom robots import RobotRegistry\nfrom {rest}"
    declared = source + _REGISTERED.format(constant=constant, name=name)
    test = _TEST.format(module=module, constant=constant, name=name)
    for path in write_new(options.out, {f"{module}.py": declared, f"test_{module}.py": test}):
        print(path)
    notice(
        f"The comments in {module}.py say what was guessed: correct it, and delete them. Test it:"
        f" python -m pytest {options.out / f'test_{module}.py'}"
    )
    return 0


main = main_of("new robot")

if __name__ == "__main__":
    start(main)
