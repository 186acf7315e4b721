"""Proof against native ManiSkill: both in one process, in lock-step, compared exactly.

The only room that imports mani_skill, and only when a native environment is made.
"""

from kinematics.own_rooms import expect_own

expect_own("robots", "layouts", "simulation", "tasks", "experts", "rollouts")
