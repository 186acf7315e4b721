"""Curves of numbers for TensorBoard or Weights & Biases, written by their own packages."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from contextlib import AbstractContextManager, contextmanager

from robot_layouts.core.importing import optional
from robot_layouts.core.writing import writing_errors
from robots import TaskError, UnknownNameError

Log = Callable[[int, Mapping[str, float]], None]
"""``log(step, {"success": 0.5})`` adds a point to the curve of each name."""

HOW = "tensorboard:DIR or wandb:PROJECT"


@contextmanager
def opened_log(where: str | None) -> Generator[Log]:
    """Open a log, and close it at the end.

    Args:
        where: ``tensorboard:DIR`` or ``wandb:PROJECT``; None: nothing is kept.

    Yields:
        What takes the numbers of a step; steps do not fall.

    Raises:
        UnknownNameError: If it is of another kind.
        TaskError: If it lacks a folder or a project, or Weights & Biases takes nothing.
        MissingPackageError: If its package is not installed.
        UnwritableFileError: If the folder cannot be written.
    """
    if where is None:
        yield lambda step, numbers: None
        return
    kind, _, place = where.partition(":")
    if kind not in _KINDS:
        raise UnknownNameError("kind of log", kind, _KINDS, f"Write {HOW}.")
    if not place:
        raise TaskError(f"the log {where!r} does not say where; write {HOW}")
    with _KINDS[kind](place) as log:
        yield log


@contextmanager
def _tensorboard(folder: str) -> Generator[Log]:
    what = "a log for TensorBoard needs tensorboard"
    tensorboard = optional("torch.utils.tensorboard", what, "log")
    with writing_errors(folder):
        writer = tensorboard.SummaryWriter(folder)

    def log(step: int, numbers: Mapping[str, float]) -> None:
        for name, number in numbers.items():
            writer.add_scalar(name, number, step)
        writer.flush()  # for those who watch

    try:
        yield log
    finally:
        writer.close()


@contextmanager
def _wandb(project: str) -> Generator[Log]:
    wandb = optional("wandb", "a log for Weights & Biases needs wandb", "wandb")
    try:
        run = wandb.init(project=project)
    except wandb.Error as error:
        hint = "log in with `wandb login`, or keep it on this machine with WANDB_MODE=offline"
        raise TaskError(f"Weights & Biases takes no log: {error}; {hint}") from error
    with run:
        yield lambda step, numbers: run.log(dict(numbers), step=step)


_KINDS: dict[str, Callable[[str], AbstractContextManager[Log]]] = {
    "tensorboard": _tensorboard,
    "wandb": _wandb,
}
