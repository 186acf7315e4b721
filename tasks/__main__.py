"""``python -m tasks COMMAND``: the same as ``robot-layouts tasks COMMAND``, but for recordings."""

from robot_layouts.core.cli import Command, Program
from robot_layouts.core.commands import start
from tasks.commands import export, preview, print_description, print_list, view

COMMANDS = {
    "list": Command(print_list),
    "describe": Command(print_description),
    "view": Command(view),
    "preview": Command(preview),
    "export": Command(export),
}
main = Program("robot-layouts tasks", COMMANDS).main

if __name__ == "__main__":
    start(main)
