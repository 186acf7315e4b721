"""Joint motions of many robots that do not collide: planned, timed, certified."""

from kinematics.own_rooms import expect_own

expect_own("robots", "layouts")

from motion.certificate import Certificate, Nearest
from motion.motion import Motion
from motion.planning.goals import Goal, RegionGoal, TcpGoal
from motion.planning.plan import plan
from robots.common.errors import MotionError, NoPlanError

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
