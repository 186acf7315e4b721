"""Clones of ManiSkill's tasks, equal to them to the last bit."""
