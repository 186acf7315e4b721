"""Many episodes: experts that solve tasks, playing them, recording them, judging policies."""

from robot_layouts.core.own_packages import expect_own

expect_own("robots", "layouts", "tasks")

from importlib import import_module
from typing import TYPE_CHECKING, Any

from robot_layouts.core.errors import missing_name

if TYPE_CHECKING:
    from robot_layouts.data.evaluation import Evaluation, Score, evaluate
    from robot_layouts.data.recording.record import record
    from robot_layouts.data.viewing import view

__all__ = ["Evaluation", "Score", "evaluate", "record", "view"]

_HOMES = {
    "record": "robot_layouts.data.recording.record",
    "view": "robot_layouts.data.viewing",
}


def __getattr__(name: str) -> Any:
    """Load what is asked for, once; it needs torch and sapien."""
    if name not in __all__:
        raise missing_name(__name__, name, __all__)
    value = globals()[name] = getattr(
        import_module(_HOMES.get(name, "robot_layouts.data.evaluation")), name
    )
    return value


def __dir__() -> list[str]:
    """List what is public, loaded or not: `help` and completion go by this."""
    return __all__
