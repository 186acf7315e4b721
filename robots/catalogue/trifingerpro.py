"""TriFinger Pro, three fingers of three joints around a stage: 9 action numbers."""

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, GripperMaterial, JointGroup, RobotDescriptor

ANGLES = (0, 120, 240)  # degrees, where the fingers hang
JOINTS = ("base_to_upper", "upper_to_middle", "middle_to_lower")
TIPS = tuple(f"finger_tip_link_{angle}" for angle in ANGLES)

TRIFINGERPRO = RobotDescriptor(
    name="trifingerpro",
    urdf=UrdfLocator("maniskill_trifinger", "trifingerpro.urdf"),
    action_split=ActionSplit(
        fingers=JointGroup(
            tuple(f"finger_{joint}_joint_{angle}" for angle in ANGLES for joint in JOINTS),
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
