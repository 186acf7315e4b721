"""Run with an address of a Ray cluster, prints whether an actor there is portable."""

import sys
from collections.abc import Callable

from robot_layouts.data.playing.ray_executor import RayExecutor
from robots import is_portable


class Ask:
    """Plays no episode, but says whether the process that was to play it is portable."""

    def __call__(self) -> Callable[[int], bool]:
        """Return what a worker does with a seed."""
        return lambda seed: is_portable()


if __name__ == "__main__":
    events = RayExecutor(sys.argv[1], 1).run(Ask(), [0])
    print(*(event.result for event in events if event.seed is not None))
