"""How fast and how reliably motions are planned, and what collision checks cost."""
