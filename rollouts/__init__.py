"""Many episodes: experts that solve tasks, playing them, recording them, judging policies."""

from kinematics.own_rooms import expect_own

expect_own("robots", "layouts", "simulation", "tasks", "experts")

from importlib import import_module
from typing import TYPE_CHECKING, Any

from robots.common.module_names import missing_name

if TYPE_CHECKING:
    from rollouts.evaluation import Evaluation, Score, evaluate
    from rollouts.recording.record import record

__all__ = ["Evaluation", "Score", "evaluate", "record"]

_HOMES = {"record": "rollouts.recording.record"}


def __getattr__(name: str) -> Any:
    """Load what is asked for, once; it needs torch and sapien."""
    if name not in __all__:
        raise missing_name(__name__, name, __all__)
    value = globals()[name] = getattr(import_module(_HOMES.get(name, "rollouts.evaluation")), name)
    return value


def __dir__() -> list[str]:
    """List what is public, loaded or not: `help` and completion go by this."""
    return __all__
