"""What a guess concludes from a robot's anatomy: its tool, grippers, drives and posture."""
