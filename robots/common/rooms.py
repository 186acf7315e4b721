"""The rooms of the library: its top-level packages."""

PLAYING = (
    "kinematics",
    "robots",
    "layouts",
    "motion",
    "simulation",
    "tasks",
    "experts",
    "rollouts",
)
"""What plays episodes, each room importing only those before it."""

ROOMS = (*PLAYING, "robot_layouts")
"""All of them."""
