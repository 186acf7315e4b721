"""Kinova Jaco 2 j2s6s200, whose two fingers do not move: 6 action numbers."""

from math import pi

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, JointGroup, RobotDescriptor, names
from robots.parts import among

TURNS = (-2 * pi, 2 * pi)  # of joints that turn without end
ARM = JointGroup(
    names("j2s6s200_joint_", 1, 6),
    lower=(-0.04, -0.04, -0.07, -0.1, -0.1, -0.1),
    upper=(0.04, 0.04, 0.07, 0.1, 0.1, 0.1),
    stiffness=(2.65e4, 3.41e4, 7530.0, 1000.0, 1000.0, 1000.0),
    damping=(353.0, 454.0, 100.0, 11.1, 11.1, 1.76),
    force_limit=(75.4, 96.9, 40.0, 20.0, 20.0, 20.0),
    delta=True,
    approximate_ik=True,
    limits=(
        TURNS,
        (0.82030475, 5.4628806),
        (0.33161256, 5.951573),
        TURNS,
        (0.5235988, 5.7595863),
        TURNS,
    ),
)

JACO2 = RobotDescriptor(
    name="jaco2",
    urdf=UrdfLocator("example_kinova_description", "robots/kinova.urdf"),
    action_split=ActionSplit(arm=ARM),
    tcp_link="j2s6s200_end_effector",
    keyframes={
        "rest": (1.33612, 2.785361, 4.285469, 0.380935, 1.684333, 0.099903),
    },
    reach=0.985,  # of the TCP, from the URDF; data sheet 0.985
    source="example-robot-data 6.0.0, kinova_description; drives from each joint's inertia",
    allowed_collisions=among(  # neighbours, and what overlaps however the joints stand
        (
            "j2s6s200_link_5",
            "j2s6s200_link_finger_1",
            "j2s6s200_link_finger_2",
            "j2s6s200_link_finger_tip_1",
            "j2s6s200_link_finger_tip_2",
        ),
    ),
)
