"""Tasks that hold on to a little more with every step; worker processes import this module."""

import os
from typing import Any

from tasks.maniskill.push_cube import PushCube

_hoard: list[Any] = []


class HoardsMemory(PushCube):
    def evaluate(self, state):
        _hoard.append(b"x" * 300_000)
        return super().evaluate(state)


class LeavesFilesOpen(PushCube):
    def evaluate(self, state):
        _hoard.append(open(os.devnull))
        return super().evaluate(state)
