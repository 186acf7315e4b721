"""Tasks of our own, for robots that ManiSkill never put at one table."""
