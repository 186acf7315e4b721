"""Universal Robots UR5 without a hand: 6 action numbers."""

from math import pi

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, JointGroup, RobotDescriptor

TURNS = (-2 * pi, 2 * pi)
ARM = JointGroup(
    ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint")
    + ("wrist_1_joint", "wrist_2_joint", "wrist_3_joint"),
    lower=(-0.04, -0.04, -0.1, -0.065, -0.065, -0.1),  # as far as the force brings them
    upper=(0.04, 0.04, 0.1, 0.065, 0.065, 0.1),
    delta=True,
    approximate_ik=True,
    stiffness=(9.85e4, 8.98e4, 1.93e4, 5670.0, 5700.0, 1000.0),
    damping=(1310.0, 1200.0, 257.0, 75.6, 76.0, 8.28),
    force_limit=(280.0, 255.0, 150.0, 28.0, 28.0, 28.0),  # data sheet 150, 150, 150, 28, 28, 28
    limits=(TURNS, TURNS, (-pi, pi), TURNS, TURNS, TURNS),
)

UR5 = RobotDescriptor(
    name="ur5",
    urdf=UrdfLocator("example_ur_description", "urdf/ur5_robot.urdf"),
    action_split=ActionSplit(arm=ARM),
    tcp_link="tool0",
    keyframes={"rest": (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)},
    reach=0.95,  # of the TCP, from the URDF; data sheet 0.85, to the wrist
    source="example-robot-data 6.0.0, ur_description; drives from each joint's inertia",
    allowed_collisions=(("ee_link", "wrist_2_link"),),
)
