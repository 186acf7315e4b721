"""How quick the page of ``teleop`` is, measured in a real browser."""
