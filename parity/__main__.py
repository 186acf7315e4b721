"""``python -m parity COMMAND``: the same as ``robot-layouts parity COMMAND``."""

from robots.common.commands import start
from robots.common.console import main_of

main = main_of("parity")

if __name__ == "__main__":
    start(main)
