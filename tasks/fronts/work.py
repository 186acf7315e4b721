"""What a worker process of a vector runs; torch learns that it has one thread before it loads."""

from __future__ import annotations

import os
import pickle
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from robots import RobotLayoutsError
from tasks.processes.channel import Channel
from tasks.processes.process import ProcessError, Sendable

if TYPE_CHECKING:
    from tasks.fronts.batch import Batch, Part


ATTACH = "attach"  # take the shared memory that comes with the call
SETTLE = "settle"  # do nothing: its answer says that what came before is done


class CallFailed(RobotLayoutsError):
    """An error in a worker that is none of ours; says what it was and where it came up."""


def work(channel: Channel) -> None:
    """Hold parts of a vector: build them, then answer calls until the main process is gone.

    Every answer has the number of its call, and is a result and an error, which is one of ours or
    a `CallFailed`. After an error, all further answers are that error: the first may have come
    when nobody waited for it any more.
    """
    os.environ["OMP_NUM_THREADS"] = "1"
    try:
        batches = _build(channel)
        if batches:
            _serve(channel, batches)
    except (EOFError, OSError):
        os._exit(0)  # dismissed, or the main process is gone


def _build(channel: Channel) -> list[Batch]:
    number, share = channel.receive()
    try:
        import torch

        from tasks.fronts.batch import Batch

        torch.set_num_threads(1)
        batches = [Batch(part) for part in _loaded(share)]
    except BaseException as error:
        channel.send(number, pickle.dumps((None, Sendable(error, CallFailed))))
        return []
    channel.send(number, pickle.dumps((batches[0].shapes(), None)))
    return batches


def _loaded(share: bytes) -> tuple[Part, ...]:
    try:
        return pickle.loads(share)
    except Exception as error:  # whatever importing a module of the user's raises
        raise ProcessError(
            f"worker processes cannot load the task: {type(error).__name__}: {error}; define its"
            " class in a module that they can import, or take num_workers=0"
        ) from error


def _serve(channel: Channel, batches: Sequence[Batch]) -> None:
    answer: tuple[Any, Sendable | None] = (None, None)
    while True:
        number, call = channel.receive()
        if answer[1] is None:
            answer = _answer(channel, batches, call)
        channel.send(number, pickle.dumps(answer))


def _answer(channel: Channel, batches: Sequence[Batch], call: bytes) -> tuple[Any, Sendable | None]:
    place, method, arguments = pickle.loads(call)
    try:
        if method == SETTLE:
            return None, None
        if method == ATTACH:
            return _attach(channel, batches, *arguments), None
        return getattr(batches[place], method)(*arguments), None
    except BaseException as error:  # a task's exit() as well: the others go on
        return None, Sendable(error, CallFailed)


def _attach(channel: Channel, batches: Sequence[Batch], shapes: Any, num_envs: int) -> None:
    from tasks.fronts.board import board_size, lay_out, map_shared_memory

    memory = map_shared_memory(channel.descriptors.pop(), board_size(shapes, num_envs))
    board = lay_out(memory, shapes, num_envs)
    for batch in batches:
        batch.attach(board)
