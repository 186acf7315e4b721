"""The packages of this library, and the folders of them that play episodes."""

PACKAGES = ("robots", "objects", "layouts", "tasks", "robot_layouts")

PLAYING = (
    "robot_layouts/core",
    "robot_layouts/kinematics",
    "robots",
    "objects",
    "layouts",
    "robot_layouts/motion",
    "robot_layouts/simulation",
    "tasks",
    "robot_layouts/experts",
    "robot_layouts/data/playing",
)
"""What has a part in an episode; the rest of `robot_layouts.data` only writes things down."""
