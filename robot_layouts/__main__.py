"""``robot-layouts COMMAND``, and the same as ``python -m robot_layouts COMMAND``.

``python -m layouts`` runs whatever is called ``layouts`` in the present folder. A console script
looks for this library first: the folder comes last, for the modules of tasks, experts and policies.
"""

from __future__ import annotations

from typing import NoReturn

from robot_layouts.core.cli import Command, Program
from robot_layouts.core.commands import start

_FOR_USERS = {
    "demo": "robot_layouts.data.demo:demo",
    "record": "robot_layouts.data.commands:record",
    "teleop": "robot_layouts.data.commands:teleop",
    "replay": "robot_layouts.data.recording.replaying:replay_command",
    "compare-engines": "robot_layouts.data.comparison:compare_command",
    "certify": "robot_layouts.data.commands:certify",
    "convert": "robot_layouts.data.recording.convert:convert_command",
    "merge": "robot_layouts.data.recording.merge:merge_command",
    "export": "robot_layouts.data.export.dataset:export_command",
    "data build": "robot_layouts.data.recipe_commands:build_command",
    "data recipe": "robot_layouts.data.recipe_commands:recipe_command",
    "data push": "robot_layouts.data.export.push:push_command",
    "report": "robot_layouts.data.dataset.report:report",
    "view": "robot_layouts.data.commands:view",
    "evaluate": "robot_layouts.data.commands:evaluate",
    "serve": "robot_layouts.data.serving.server:serve_command",
    "verify": "robot_layouts.data.commands:verify",
    "suite show": "robot_layouts.data.suite.command:show",
    "suite run": "robot_layouts.data.suite.command:run",
    "suite report": "robot_layouts.data.suite.command:report",
    "suite verify": "robot_layouts.data.suite.command:verify",
    "tasks list": "tasks.commands:print_list",
    "tasks describe": "tasks.commands:print_description",
    "tasks view": "robot_layouts.data.commands:view_task",
    "tasks preview": "tasks.commands:preview",
    "tasks export": "tasks.commands:export",
    "tasks check": "robot_layouts.data.gate:check",
    "tasks elsewhere": "robot_layouts.data.elsewhere:elsewhere",
    "layouts show": "layouts.commands:show",
    "layouts validate": "layouts.commands:validate",
    "layouts search": "layouts.commands:search",
    "layouts view": "layouts.commands:view",
    "layouts export": "layouts.commands:export",
    "motion plan": "robot_layouts.motion.commands:plan",
    "motion certify": "robot_layouts.motion.commands:certify",
    "motion show": "robot_layouts.motion.commands:show",
    "motion draw": "robot_layouts.motion.commands:draw",
    "motion export": "robot_layouts.motion.commands:export",
    "robots list": "robots.inspect:list_robots",
    "robots inspect": "robot_layouts.simulation.checks.commands:inspect_robots",
    "robots fetch": "robots.fetch_assets:fetch",
    "robots guess": "robots.from_urdf:print_guess",
    "objects list": "objects.inspect:list_objects",
    "objects inspect": "robot_layouts.simulation.checks.commands:inspect_objects",
    "objects fetch": "objects.inspect:fetch",
    "objects show": "objects.picture:show",
    "new task": "tasks.new_task:new_task",
    "new robot": "robots.from_urdf:new_robot",
}
_FOR_DEVELOPERS = {
    "portable": "robots.portable:portable",
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


if __name__ == "__main__":
    run()
