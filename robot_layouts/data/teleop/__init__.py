"""People steer the arms of a task from a browser, and what they do is recorded."""
