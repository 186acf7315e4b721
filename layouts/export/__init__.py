"""A layout for other programs: URDF, Drake's directives, MJCF, USD, and a ROS 2 package."""
