"""What a worker process of a vector runs; torch learns that it has one thread before it loads."""

from __future__ import annotations

import os
import pickle
from multiprocessing import reduction
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from robots import RobotLayoutsError
from tasks.processes.process import ProcessError, Sendable

if TYPE_CHECKING:
    from tasks.fronts.batch import Batch, Part


class CallFailed(RobotLayoutsError):
    """An error in a worker that is none of ours; says what it was and where it came up."""


def work(connection: Connection) -> None:
    """Hold one part of a vector: build it, then answer calls until the main process is gone.

    Every answer is a result and an error, which is one of ours or a `CallFailed`.
    """
    os.environ["OMP_NUM_THREADS"] = "1"
    try:
        batch = _build(connection)
        if batch is not None:
            _serve(connection, batch)
    except (EOFError, OSError):
        os._exit(0)  # dismissed, or the main process is gone


def _build(connection: Connection) -> Batch | None:
    part = connection.recv_bytes()
    try:
        import torch

        from tasks.fronts.batch import Batch

        torch.set_num_threads(1)
        batch = Batch(_loaded(part))
    except BaseException as error:
        connection.send((None, Sendable(error, CallFailed)))
        return None
    connection.send((batch.shapes(), None))
    return batch


def _loaded(part: bytes) -> Part:
    try:
        return pickle.loads(part)
    except Exception as error:  # whatever importing a module of the user's raises
        raise ProcessError(
            f"worker processes cannot load the task: {type(error).__name__}: {error}; define its"
            " class in a module that they can import, or take num_workers=0"
        ) from error


def _serve(connection: Connection, batch: Batch) -> None:
    while True:
        method, arguments = connection.recv()
        try:
            if method == "attach":
                answer = _attach(connection, batch, *arguments)
            else:
                answer = getattr(batch, method)(*arguments)
        except BaseException as error:  # a task's exit() as well: the others go on
            connection.send((None, Sendable(error, CallFailed)))
        else:
            connection.send_bytes(pickle.dumps((answer, None)))


def _attach(connection: Connection, batch: Batch, shapes: Any, num_envs: int) -> None:
    from tasks.fronts.board import board_size, lay_out, map_shared_memory

    memory = map_shared_memory(reduction.recv_handle(connection), board_size(shapes, num_envs))
    batch.attach(lay_out(memory, shapes, num_envs))
