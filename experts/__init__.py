"""Scripted experts: for a task and a seed, the actions that solve it."""

from kinematics.own_rooms import expect_own

expect_own("robots", "layouts", "simulation", "tasks")

from experts.registry import Expert, find_expert, list_experts, register_expert

__all__ = ["Expert", "find_expert", "list_experts", "register_expert"]
