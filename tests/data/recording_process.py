"""``python -m tests.data.recording_process record ...``: with an expert that costs nothing."""

import sys

from robot_layouts.__main__ import main
from robot_layouts.experts import register_expert
from tests.data.plays import TASK, at_random

if __name__ == "__main__":
    register_expert(TASK, at_random)
    sys.exit(main())
