"""``python -m motion COMMAND``: the same as ``robot-layouts motion COMMAND``."""

from motion.commands import certify, draw, export, plan, show
from robots.common.cli import Command, Program
from robots.common.commands import start

COMMANDS = {one.__name__: Command(one) for one in (plan, certify, show, draw, export)}
main = Program("robot-layouts motion", COMMANDS).main

if __name__ == "__main__":
    start(main)
