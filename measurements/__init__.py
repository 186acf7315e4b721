"""What everything costs, and whether anything grows; no other room needs it."""
