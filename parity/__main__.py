"""``python -m parity COMMAND``: the same as ``robot-layouts parity COMMAND``."""

from robot_layouts.__main__ import main_of
from robots.common.commands import start

main = main_of("parity")

if __name__ == "__main__":
    start(main)
