"""Every task stepped for long, while nothing that its processes hold may grow."""
