"""Experts for ManiSkill's tasks."""
