"""Wonik Allegro right hand, four fingers of four joints: 16 action numbers."""

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, GripperMaterial, Home, JointGroup, RobotDescriptor, names

FINGER = ((-0.47, 0.47), (-0.196, 1.61), (-0.174, 1.709), (-0.227, 1.618))
THUMB = ((0.263, 1.396), (-0.105, 1.163), (-0.189, 1.644), (-0.162, 1.719))
TIPS = ("link_15.0_tip", "link_3.0_tip", "link_7.0_tip", "link_11.0_tip")  # the thumb's first

ALLEGRO_HAND_RIGHT = RobotDescriptor(
    name="allegro_hand_right",
    urdf=UrdfLocator("maniskill_allegro", "allegro_hand_right_glb.urdf"),
    action_split=ActionSplit(
        fingers=JointGroup(
            names("joint_", 0, 15, ".0"),
            lower=-0.1,
            upper=0.1,
            delta=True,
            stiffness=4e2,
            damping=1e1,
            force_limit=5e1,
            limits=(*FINGER, *FINGER, *FINGER, *THUMB),
        )
    ),
    tcp_link="link_3.0_tip",
    tcp_position_links=TIPS,
    gripper_material=GripperMaterial(TIPS, 2.0, 1.0, 0.0, patch_radius=0.1),
    # ManiSkill's zeros but for the first joint of the thumb, which cannot reach zero.
    keyframes={"rest": (*(0,) * 12, 0.263, 0, 0, 0)},
    home=Home(position=(0.0, 0.0, 0.5)),
    reach=0.12,  # of the middle of the tips, from the URDF
    source="mani_skill 3.0.1, agents/robots/allegro_hand/allegro.py",
)
