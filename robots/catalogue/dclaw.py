"""D'Claw of ROBEL, three fingers of three joints that point down: 9 action numbers."""

from robots.assets.locator import UrdfLocator
from robots.descriptor import (
    ActionSplit,
    GripperMaterial,
    Home,
    JointGroup,
    NativeAgent,
    RobotDescriptor,
)

HEADS = ("link_f1_head", "link_f2_head", "link_f3_head")
TIPS = ("link_f1_3", "link_f2_3", "link_f3_3")
OUTWARD, INWARD = (-0.524, 1.32), (-1.32, 0.524)

DCLAW = RobotDescriptor(
    name="dclaw",
    urdf=UrdfLocator("maniskill_dclaw", "dclaw_gripper_glb.urdf"),
    action_split=ActionSplit(
        joint=JointGroup(
            (
                "joint_f1_0",
                "joint_f2_0",
                "joint_f3_0",
                "joint_f1_1",
                "joint_f2_1",
                "joint_f3_1",
                "joint_f1_2",
                "joint_f2_2",
                "joint_f3_2",
            ),
            lower=-0.1,
            upper=0.1,
            delta=True,
            stiffness=1e2,
            damping=1e1,
            force_limit=2e1,
            limits=(OUTWARD, INWARD, INWARD, *((-1.57, 1.57),) * 6),
        )
    ),
    tcp_link="link_f1_head",
    tcp_position_links=HEADS,
    gripper_material=GripperMaterial(TIPS, 2.0, 1.0, 0.0, patch_radius=0.1),
    keyframes={"rest": (0,) * 9},
    home=Home(position=(0.0, 0.0, 0.5), quaternion=(0.0, 0.0, -1.0, 0.0)),
    native_agent=NativeAgent(tip_links=HEADS),
    reach=0.16,  # of the middle of the tips, from the URDF
    source="mani_skill 3.0.1, agents/robots/dclaw/dclaw.py",
)
