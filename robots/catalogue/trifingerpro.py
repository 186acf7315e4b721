"""TriFinger Pro, three fingers of three joints around a stage: 9 action numbers."""

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, GripperMaterial, JointGroup, RobotDescriptor

ANGLES = (0, 120, 240)  # degrees, where the fingers hang
JOINTS = ("base_to_upper", "upper_to_middle", "middle_to_lower")
TIPS = ("finger_tip_link_0", "finger_tip_link_120", "finger_tip_link_240")

TRIFINGERPRO = RobotDescriptor(
    name="trifingerpro",
    urdf=UrdfLocator("maniskill_trifinger", "trifingerpro.urdf"),
    action_split=ActionSplit(
        fingers=JointGroup(
            (
                "finger_base_to_upper_joint_0",
                "finger_upper_to_middle_joint_0",
                "finger_middle_to_lower_joint_0",
                "finger_base_to_upper_joint_120",
                "finger_upper_to_middle_joint_120",
                "finger_middle_to_lower_joint_120",
                "finger_base_to_upper_joint_240",
                "finger_upper_to_middle_joint_240",
                "finger_middle_to_lower_joint_240",
            ),
            lower=-0.1,
            upper=0.1,
            delta=True,
            stiffness=1e2,
            damping=1e1,
            force_limit=2e1,
            limits=((-0.33, 1.0), (0.0, 1.57), (-2.7, 0.0)) * 3,
        )
    ),
    tcp_link="finger_tip_link_0",
    tcp_position_links=TIPS,
    gripper_material=GripperMaterial(TIPS, 2.0, 1.0),
    keyframes={"rest": (0.0, 0.9, -1.7) * 3},
    reach=0.21,  # of the middle of the tips, from the URDF
    source="mani_skill 3.0.1, agents/robots/trifingerpro/trifingerpro.py",
)
