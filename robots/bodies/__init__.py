"""What robots bump into things with, and which of their links may touch each other."""
