"""Proof against native ManiSkill: both in one process, in lock-step, compared exactly.

A tool for developers: ``python -m parity COMMAND`` in a checkout. Nothing else imports mani_skill,
and this only when a native environment is made.
"""
