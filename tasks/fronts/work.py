"""What a worker process of a vector runs; torch learns that it has one thread before it loads."""

from __future__ import annotations

import os
import pickle
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
    """Hold one part of a vector: build it, then answer calls until the main process is gone.

    Every answer has the number of its call, and is a result and an error, which is one of ours or
    a `CallFailed`. After an error, all further answers are that error: the first may have come
    when nobody waited for it any more.
    """
    os.environ["OMP_NUM_THREADS"] = "1"
    try:
        batch = _build(channel)
        if batch is not None:
            _serve(channel, batch)
    except (EOFError, OSError):
        os._exit(0)  # dismissed, or the main process is gone


def _build(channel: Channel) -> Batch | None:
    number, part = channel.receive()
    try:
        import torch

        from tasks.fronts.batch import Batch

        torch.set_num_threads(1)
        batch = Batch(_loaded(part))
    except BaseException as error:
        channel.send(number, pickle.dumps((None, Sendable(error, CallFailed))))
        return None
    channel.send(number, pickle.dumps((batch.shapes(), None)))
    return batch


def _loaded(part: bytes) -> Part:
    try:
        return pickle.loads(part)
    except Exception as error:  # whatever importing a module of the user's raises
        raise ProcessError(
            f"worker processes cannot load the task: {type(error).__name__}: {error}; define its"
            " class in a module that they can import, or take num_workers=0"
        ) from error


def _serve(channel: Channel, batch: Batch) -> None:
    answer: tuple[Any, Sendable | None] = (None, None)
    while True:
        number, call = channel.receive()
        if answer[1] is None:
            answer = _answer(channel, batch, call)
        channel.send(number, pickle.dumps(answer))


def _answer(channel: Channel, batch: Batch, call: bytes) -> tuple[Any, Sendable | None]:
    method, arguments = pickle.loads(call)
    try:
        if method == SETTLE:
            return None, None
        if method == ATTACH:
            return _attach(channel, batch, *arguments), None
        return getattr(batch, method)(*arguments), None
    except BaseException as error:  # a task's exit() as well: the others go on
        return None, Sendable(error, CallFailed)


def _attach(channel: Channel, batch: Batch, shapes: Any, num_envs: int) -> None:
    from tasks.fronts.board import board_size, lay_out, map_shared_memory

    memory = map_shared_memory(channel.descriptors.pop(), board_size(shapes, num_envs))
    batch.attach(lay_out(memory, shapes, num_envs))
