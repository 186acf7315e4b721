"""Under which names other programs know a task."""

NAMESPACE = "RobotLayouts"  # Gymnasium ids are RobotLayouts/PickCube-v1
