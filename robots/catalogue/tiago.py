"""PAL Robotics TIAGo without a hand, whose base and torso stand still: 7 action numbers."""

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, JointGroup, RobotDescriptor, names
from robots.parts import among

ARM = JointGroup(
    names("arm_", 1, 7, "_joint"),
    lower=(-0.04, -0.04, -0.055, -0.065, -0.1, -0.1, -0.1),
    upper=(0.04, 0.04, 0.055, 0.065, 0.1, 0.1, 0.1),
    stiffness=(4.06e4, 2.42e4, 4510.0, 3840.0, 1000.0, 1000.0, 1000.0),
    damping=(541.0, 322.0, 60.1, 51.1, 2.42, 2.12, 0.127),
    force_limit=(115.0, 68.7, 17.9, 17.9, 3.0, 6.6, 6.6),
    delta=True,
    approximate_ik=True,
    limits=(
        (0.0, 2.7488935),
        (-1.5707964, 1.0908308),
        (-3.5342917, 1.5707964),
        (-0.3926991, 2.3561945),
        (-2.0943952, 2.0943952),
        (-1.4137167, 1.4137167),
        (-2.0943952, 2.0943952),
    ),
)
TORSO_SLIDE = JointGroup.hold(("torso_lift_joint",), unit="m")
HEAD = JointGroup.hold(("head_1_joint", "head_2_joint"))
WHEELS = JointGroup.hold(("wheel_right_joint", "wheel_left_joint"))
BASE = (
    "base_antenna_left_link",
    "base_antenna_right_link",
    "caster_back_left_2_link",
    "caster_back_right_2_link",
    "caster_front_left_2_link",
    "caster_front_right_2_link",
    "torso_fixed_column_link",
    "torso_fixed_link",
)

TIAGO = RobotDescriptor(
    name="tiago",
    urdf=UrdfLocator("example_tiago_description", "robots/tiago_no_hand.urdf"),
    action_split=ActionSplit(arm=ARM, torso_slide=TORSO_SLIDE, head=HEAD, wheels=WHEELS),
    tcp_link="arm_tool_link",
    keyframes={"rest": (0.9, 0.0, -1.6, 1.6, -0.5, -0.2, 0.0, *(0,) * 5)},
    reach=0.891,  # of the TCP, from the URDF
    source="example-robot-data 6.0.0, tiago_description; drives from each joint's inertia",
    allowed_collisions=among(  # neighbours, and what overlaps however the joints stand
        (*BASE[:2], "base_link", *BASE[2:7], "torso_lift_link"),
        (*BASE, "wheel_left_link"),
        (*BASE, "wheel_right_link"),
        ("arm_6_link", "arm_tool_link", "wrist_ft_link", "wrist_ft_tool_link"),
        ("arm_1_link", "torso_fixed_column_link"),
    ),
)
