"""How many calls of this library's own functions the main verbs take, at most.

Unlike seconds, calls do not depend on the machine. A number may go down at any time; a change that
raises one says why.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import tasks
from tests.fresh_process import in_fresh_process

ROOT = str(Path(__file__).resolve().parents[1])
MOST = {
    "make, first": 7_650,
    "make, again": 2_850,
    "step": 130,
    "plan": 12_500,
    "search": 73_000,
    "from_urdf": 11_000,
}


def calls_of(function: Callable[[], Any]) -> tuple[int, Any]:
    """Return how many calls of our functions a function makes, and what it returns."""
    count = 0

    def note(frame: Any, event: str, argument: object) -> None:
        nonlocal count
        file = frame.f_code.co_filename
        count += event == "call" and file.startswith(ROOT) and "site-packages" not in file

    sys.setprofile(note)
    try:
        found = function()
    finally:
        sys.setprofile(None)
    return count, found


def calls_of_verbs() -> tuple[dict[str, int], list[str]]:
    """Return the calls of each verb, and which of SAPIEN's readers of URDFs were loaded."""
    import layouts
    import tasks
    from robot_layouts import motion
    from robots import RobotDescriptor
    from tests.motion.two_pandas import aside, cell, turned
    from tests.robots.test_from_urdf import urdf_of

    counts: dict[str, int] = {}
    counts["make, first"], env = calls_of(lambda: tasks.make("TwoRobotPickCube-v1"))
    readers = [name for name in sys.modules if "urchin" in name or "urdf_loader" in name]
    counts["make, again"], _ = calls_of(lambda: tasks.make("TwoRobotPickCube-v1"))
    env.reset(seed=0)
    env.step(env.action_space.sample())
    counts["step"], _ = calls_of(lambda: env.step(env.action_space.sample()))
    goals = {"left": turned("left", -1.4)[:7]}
    counts["plan"], _ = calls_of(lambda: motion.plan(cell(), aside(), goals))
    robots, cube = {"left": "panda", "right": "panda"}, {"cube": (0.4, 0.0, 0.2)}
    counts["search"], _ = calls_of(lambda: layouts.search(robots, cube, tries=1))
    counts["from_urdf"], _ = calls_of(
        lambda: RobotDescriptor.from_urdf(urdf_of("panda"), quiet=True)
    )
    return counts, readers


def test_calls_stay_within_their_budget():
    tasks.make("TwoRobotPickCube-v1")  # which reads the robots' files, once on a machine
    counts, readers = in_fresh_process(calls_of_verbs)
    assert readers == [], "a robot is built without them"
    assert list(counts) == list(MOST)
    assert {verb: n for verb, n in counts.items() if n > MOST[verb]} == {}
