"""``python -m layouts COMMAND``: the same as ``robot-layouts layouts COMMAND``."""

from layouts.commands import export, search, show, validate, view
from robot_layouts.core.cli import Command, Program
from robot_layouts.core.commands import start

COMMANDS = {one.__name__: Command(one) for one in (show, validate, search, view, export)}
main = Program("robot-layouts layouts", COMMANDS).main

if __name__ == "__main__":
    start(main)
