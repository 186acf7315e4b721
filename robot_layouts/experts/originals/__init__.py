"""Experts for our own tasks."""
