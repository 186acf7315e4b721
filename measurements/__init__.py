"""What everything costs, and whether anything grows; no other room needs it."""

from kinematics.own_rooms import expect_own

expect_own("robots", "layouts", "motion", "simulation", "tasks", "experts", "rollouts")
