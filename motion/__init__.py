"""Joint motions of many robots that do not collide: planned, timed, certified."""

from kinematics.own_rooms import expect_own

expect_own("robots", "layouts")
