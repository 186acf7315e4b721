"""``robot-layouts COMMAND``, and the same as ``python -m robot_layouts COMMAND``.

``python -m tasks`` runs whatever is called ``tasks`` in the present folder. A console script looks
for this library first: the folder comes last, for the modules of tasks, experts and policies.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import NoReturn

from robots.common.cli import Command, Program
from robots.common.commands import start

_FOR_USERS = {
    "demo": "rollouts.commands:demo",
    "record": "rollouts.recording.record_command:record",
    "teleop": "rollouts.commands:teleop",
    "replay": "rollouts.commands:replay",
    "certify": "rollouts.dataset.certify_command:certify",
    "convert": "rollouts.commands:convert",
    "export": "rollouts.commands:export",
    "report": "rollouts.commands:report",
    "view": "rollouts.commands:view",
    "evaluate": "rollouts.evaluate_command:evaluate",
    "verify": "rollouts.receipts.verify_command:verify",
    "suite show": "rollouts.suite.command:show",
    "suite run": "rollouts.suite.command:run",
    "suite report": "rollouts.suite.command:report",
    "suite verify": "rollouts.suite.command:verify",
    "tasks list": "tasks.commands:print_list",
    "tasks describe": "tasks.commands:print_description",
    "tasks view": "rollouts.commands:view_task",
    "tasks preview": "tasks.commands:preview",
    "layouts show": "layouts.commands:show",
    "layouts validate": "layouts.commands:validate",
    "layouts search": "layouts.commands:search",
    "layouts view": "layouts.commands:view",
    "layouts export": "layouts.commands:export",
    "motion plan": "motion.commands:plan",
    "motion certify": "motion.commands:certify",
    "motion show": "motion.commands:show",
    "motion draw": "motion.commands:draw",
    "motion export": "motion.commands:export",
    "robots list": "robots.inspect:list_robots",
    "robots inspect": "simulation.checks.try_command:inspect",
    "robots fetch": "robots.fetch_assets:fetch",
    "robots guess": "robots.from_urdf:print_guess",
    "new task": "tasks.new_task:new_task",
    "new robot": "robots.new_robot:new_robot",
}
_FOR_DEVELOPERS = {
    "portable": "robots.portable:portable",
    "robots manifest": "robots.write_manifest:write_manifest",
}

PROGRAM = Program(
    "robot-layouts",
    {name: Command(target) for name, target in _FOR_USERS.items()},
    {name: Command(target) for name, target in _FOR_DEVELOPERS.items()},
)
main = PROGRAM.main


def run() -> NoReturn:
    """Be the console script."""
    start(main)


def main_of(name: str) -> Callable[..., int]:
    """Return what ``python -m`` runs for a command, or for all with the same first word."""
    return lambda arguments=None: main(
        [*name.split(), *(sys.argv[1:] if arguments is None else arguments)]
    )


if __name__ == "__main__":
    run()
