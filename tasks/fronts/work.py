"""What a worker process of a vector runs; torch learns that it has one thread before it loads."""

from __future__ import annotations

import os
import pickle
import traceback
from multiprocessing import reduction
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any

from robots import RobotLayoutsError
from tasks.processes import end_with_parent

if TYPE_CHECKING:
    from tasks.fronts.batch import Batch


def work(connection: Connection) -> None:
    """Hold one part of a vector: build it, then answer calls until the main process is gone.

    Every answer is a result and an error. An error of ours while building is sent as it is.
    """
    os.environ["OMP_NUM_THREADS"] = "1"
    end_with_parent()
    try:
        _serve(connection, _build(connection))
    except (EOFError, OSError):
        os._exit(0)  # dismissed, or the main process is gone


def _build(connection: Connection) -> Batch:
    try:
        part = connection.recv()
        import torch

        from tasks.fronts.batch import Batch

        torch.set_num_threads(1)
        batch = Batch(part)
    except (EOFError, ConnectionError):
        raise
    except RobotLayoutsError as error:
        connection.send((None, error))
        raise EOFError from error
    except Exception as error:
        connection.send((None, _said(error)))
        raise EOFError from error
    connection.send((batch.shapes(), None))
    return batch


def _serve(connection: Connection, batch: Batch) -> None:
    while True:
        method, arguments = connection.recv()
        try:
            if method == "attach":
                answer = _attach(connection, batch, *arguments)
            else:
                answer = getattr(batch, method)(*arguments)
        except Exception as error:
            connection.send((None, _said(error)))
        else:
            connection.send_bytes(pickle.dumps((answer, None)))


def _attach(connection: Connection, batch: Batch, shapes: Any, num_envs: int) -> None:
    from tasks.fronts.board import board_size, lay_out, map_shared_memory

    memory = map_shared_memory(reduction.recv_handle(connection), board_size(shapes, num_envs))
    batch.attach(lay_out(memory, shapes, num_envs))


def _said(error: Exception) -> str:
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"failed with {type(error).__name__}: {error} ({last.filename}:{last.lineno})"
