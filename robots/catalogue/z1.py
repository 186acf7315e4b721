"""Unitree Z1 with its gripper of one moving jaw: 6 + 1 action numbers."""

from robots.assets.locator import UrdfLocator
from robots.descriptor import (
    ActionSplit,
    Fingers,
    GripperMaterial,
    JointGroup,
    RobotDescriptor,
    names,
)
from robots.parts import among

ARM = JointGroup(
    names("joint", 1, 6),
    lower=(-0.04, -0.04, -0.06, -0.1, -0.1, -0.1),
    upper=(0.04, 0.04, 0.06, 0.1, 0.1, 0.1),
    stiffness=(1.77e4, 2.48e4, 6780.0, 1200.0, 1000.0, 1000.0),
    damping=(236.0, 331.0, 90.4, 16.0, 9.47, 1.99),
    force_limit=(50.4, 70.6, 30.0, 30.0, 30.0, 30.0),
    delta=True,
    approximate_ik=True,
    limits=(
        (-2.6179938, 2.6179938),
        (0.0, 2.9670596),
        (-2.8797932, 0.0),
        (-1.5184364, 1.5184364),
        (-1.3439035, 1.3439035),
        (-2.7925267, 2.7925267),
    ),
)
GRIPPER = JointGroup(
    ("jointGripper",),
    lower=0.0,
    upper=1.5707,
    stiffness=1000.0,
    damping=200.0,
    force_limit=30.0,
    mimic=True,
    multipliers=(-1.0,),
    reset_noise=False,
    limits=((-1.5707, 0.0),),
)

Z1 = RobotDescriptor(
    name="z1",
    urdf=UrdfLocator("example_z1_description", "urdf/z1.urdf"),
    action_split=ActionSplit(arm=ARM, gripper=GRIPPER),
    tcp_link="gripperStator",
    tcp_offset=(0.1425, 0.0, -0.0089),  # where the jaws' tips meet
    gripper_material=GripperMaterial(
        ("gripperStator", "gripperMover"),
        2.0,
        2.0,
        0.0,
        patch_radius=0.1,
    ),
    fingers=Fingers(
        links=("gripperStator", "gripperMover"),
        opening_signs=(1, 1),
        max_angle=110.0,  # the moving jaw swings, it does not slide
        opening_axes=((0.746, 0.0, -0.666), (0.0, 0.0, 1.0)),  # as the tips part
    ),
    keyframes={
        "rest": (0.0, 1.4, -0.75, 0.0, 0.0, 0.0, -1.5707),
    },
    reach=0.888,  # of the TCP, from the URDF; data sheet 0.74
    source="example-robot-data 6.0.0, z1_description; drives from each joint's inertia",
    allowed_collisions=among(  # neighbours, and what overlaps however the joints stand
        ("gripperMover", "link06"),
    ),
)
