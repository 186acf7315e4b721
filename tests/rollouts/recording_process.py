"""``python -m tests.rollouts.recording_process record ...``: with an expert that costs nothing."""

import sys

from experts import register_expert
from rollouts.__main__ import main
from tests.rollouts.plays import TASK, at_random

if __name__ == "__main__":
    register_expert(TASK, at_random)
    sys.exit(main())
