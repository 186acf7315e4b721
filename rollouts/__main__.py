"""``python -m rollouts COMMAND``: the same as ``robot-layouts COMMAND``."""

from robots.common.commands import start
from robots.common.console import main

if __name__ == "__main__":
    start(main)
