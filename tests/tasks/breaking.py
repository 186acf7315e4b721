"""Tasks that break, each in one place and one way; worker processes import this module."""

import ctypes
import os
import sys
import time
from contextlib import contextmanager
from threading import Lock

import gymnasium

from robots import TaskError
from tasks import registry
from tasks.maniskill.push_cube import PushCube
from tasks.registry import register_task

HOOKS = ("build", "sample", "evaluate", "observe", "dense_reward", "begin_episodes", "respond")


class NeedsTwo(Exception):
    """An error that cannot be pickled."""

    def __init__(self, first, second):
        super().__init__("needs two")


class Wordless(Exception):
    """An error that cannot even be printed."""

    def __str__(self):
        raise ValueError("no words")


def _recurse():
    return _recurse()


def _raise(error):
    raise error


WAYS = {
    "ValueError": lambda: _raise(ValueError("on purpose")),
    "an error in many lines": lambda: _raise(ValueError("on\npurpose\n" * 3)),
    "an error that cannot be pickled": lambda: _raise(NeedsTwo(1, 2)),
    "an error that cannot be printed": lambda: _raise(Wordless()),
    "an OSError": lambda: open("/nowhere"),
    "an EOFError": lambda: _raise(EOFError("on purpose")),
    "a BrokenPipeError": lambda: _raise(BrokenPipeError("on purpose")),
    "endless recursion": _recurse,
    "a MemoryError": lambda: bytearray(2**62),
    "KeyboardInterrupt": lambda: _raise(KeyboardInterrupt),
    "sys.exit": lambda: sys.exit("on purpose"),
    "os._exit": lambda: os._exit(3),
    "os.abort": os.abort,
    "a segmentation fault": lambda: ctypes.string_at(0),
}


class Breaks(PushCube):
    """Breaks in one of its hooks, at once or after the first step, in the first worker."""

    hook, way, late = "", "ValueError", False

    def meets(self, hook):
        """Break if this is the place and the time."""
        if "_first" not in vars(self):  # before any reset that names a seed
            self._first = self._rngs[0].seed == self.first_seed
        if hook == self.hook and self._first and (not self.late or self._elapsed.any()):
            WAYS[self.way]()


def _in_hook(name):
    inherited = getattr(PushCube, name)

    def hook(self, *args):
        self.meets(name)
        return inherited(self, *args)

    return hook


TASKS = {}  # id → class of each task that can be offered


def _offer(name, **attributes):
    hooks = {attributes["hook"]: _in_hook(attributes["hook"])}
    cls = type(name, (Breaks,), {**attributes, **hooks, "__module__": __name__})
    globals()[name] = TASKS[f"{name}-v1"] = cls


for _hook in HOOKS:
    for _late in (False, True):
        _offer(f"Breaks_{_hook}_{'late' if _late else 'soon'}", hook=_hook, late=_late)
for _i, _way in enumerate(WAYS):
    _offer(f"BreaksBy_{_i}", hook="evaluate", way=_way, late=True)


class SlowSteps(PushCube):
    """Takes its time over every step, in C code that holds no lock."""

    def evaluate(self, state):
        time.sleep(0.2 if self._elapsed.any() else 0.0)
        return super().evaluate(state)


class BusySteps(PushCube):
    """Never returns from its first step, in C code that lets no other thread run."""

    def evaluate(self, state):
        if self._elapsed.any():
            sum(range(10**12))
        return super().evaluate(state)


class SlowBuild(PushCube):
    """Takes its time to build a world."""

    def build(self, world):
        time.sleep(0.5)
        super().build(world)


class Forks(PushCube):
    """Leaves a process behind for a while, which holds open all that its worker has open."""

    def build(self, world):
        super().build(world)
        if os.fork() == 0:
            time.sleep(30)
            os._exit(0)


class Grows(PushCube):
    """Has other keys after its first reset."""

    def evaluate(self, state):
        more = {"more": self._elapsed > 0} if self._elapsed.any() else {}
        return {**super().evaluate(state), **more}


class Refuses(PushCube):
    """Cannot be built, for a reason of ours."""

    def build(self, world):
        raise TaskError("no such goal")


TASKS.update(
    {f"{cls.__name__}-v1": cls for cls in (SlowSteps, BusySteps, SlowBuild, Forks, Grows, Refuses)}
)


_offers: list[object] = []  # who needs these tasks now; any thread of a test may
_offering = Lock()


@contextmanager
def offered():
    """Register these tasks meanwhile, so that no other test meets them in the catalogue."""
    with _offering:
        if not _offers:
            for task_id, cls in TASKS.items():
                register_task(task_id)(cls)
        _offers.append(None)
    try:
        yield
    finally:
        with _offering:
            _offers.pop()
            if not _offers:
                for task_id in TASKS:
                    del registry.TASKS.registered[task_id]
                    gymnasium.registry.pop(f"RobotLayouts/{task_id}", None)
