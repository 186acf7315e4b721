"""Joint motions of many robots that do not collide: planned, timed, certified."""

from robot_layouts.core.own_packages import expect_own

expect_own("robots", "layouts")

from robot_layouts.core.errors import MotionError, NoPlanError
from robot_layouts.motion.certificate import Certificate, Nearest
from robot_layouts.motion.motion import Motion
from robot_layouts.motion.planning.goals import Goal, RegionGoal, TcpGoal
from robot_layouts.motion.planning.plan import plan

__all__ = [
    "Certificate",
    "Goal",
    "Motion",
    "MotionError",
    "Nearest",
    "NoPlanError",
    "RegionGoal",
    "TcpGoal",
    "plan",
]


def __dir__() -> list[str]:
    """List what is public: `help` and completion go by this."""
    return __all__
