"""SO-101 by TheRobotStudio, a small arm with one moving jaw: 5 + 1 action numbers."""

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, Fingers, GripperMaterial, JointGroup, RobotDescriptor

ARM = JointGroup(
    ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"),
    lower=-0.1,
    upper=0.1,
    stiffness=1000.0,
    damping=(10.2, 9.71, 5.87, 2.0, 0.535),
    force_limit=10.0,
    delta=True,
    limits=(
        (-1.91986, 1.91986),
        (-1.74533, 1.74533),
        (-1.69, 1.69),
        (-1.65806, 1.65806),
        (-2.74385, 2.84121),
    ),
)
GRIPPER = JointGroup(
    ("gripper",),
    lower=-0.174533,
    upper=1.74533,
    stiffness=1000.0,
    damping=10.6,  # critical, with the motor's inertia
    force_limit=2.94,
    armature=0.028,  # without it the jaw is so light that PhysX lets it sink into what it holds
    reset_noise=False,
    limits=((-0.174533, 1.74533),),
)

SO101 = RobotDescriptor(
    name="so101",
    urdf=UrdfLocator("example_so_arm_description", "urdf/so101.urdf"),
    action_split=ActionSplit(arm=ARM, gripper=GRIPPER),
    tcp_link="gripper_frame_link",
    gripper_material=GripperMaterial(
        ("gripper_link", "moving_jaw_so101_v1_link"),
        2.0,
        2.0,
        0.0,
        patch_radius=0.1,
    ),
    fingers=Fingers(
        links=("gripper_link", "moving_jaw_so101_v1_link"),
        opening_signs=(-1, 1),
        max_angle=110.0,  # the moving jaw swings, it does not slide
        opening_axes=((0.785, 0.0, 0.619), (1.0, 0.0, 0.0)),  # as the tips part
    ),
    keyframes={
        "rest": (0.0, -0.4, 0.4, 1.2, 0.0, 1.0),
    },
    reach=0.48,  # of the TCP, from the URDF
    source="example-robot-data 6.0.0, so_arm_description; drives from each joint's inertia, those"
    " of the jaw's motor (STS3215) from TheRobotStudio's MuJoCo model of the arm",
    allowed_collisions=(),
)
