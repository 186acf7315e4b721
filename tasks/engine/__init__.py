"""What runs a task: resets, steps, observations, state dicts, and checks of its arguments."""
