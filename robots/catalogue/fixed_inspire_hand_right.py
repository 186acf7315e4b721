"""Inspire RH56DFX right hand on its wrist, five fingers: 2 + 6 action numbers."""

from dataclasses import replace
from math import cos, pi, sin

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, GripperMaterial, Home, JointGroup, RobotDescriptor
from robots.parts import among

WRIST = JointGroup(
    ("right_hand_wrist_pitch_joint", "right_hand_wrist_yaw_joint"),
    lower=-0.1,
    upper=0.1,
    delta=True,
    stiffness=1e3,
    damping=1e2,
    force_limit=100.0,
    limits=((-0.3954916, 0.38606682), (-0.44505897, 0.44505897)),
)
THUMB_TURN = JointGroup(
    ("right_hand_thumb_CMC_yaw_joint",),
    lower=-0.1,
    upper=0.1,
    delta=True,
    stiffness=1e3,
    damping=1e2,
    force_limit=20.0,
    limits=((-1.3089969, 0.0),),
)
# The joints that follow are driven like those they follow, as the URDF couples them.
THUMB = JointGroup(
    ("right_hand_thumb_CMC_pitch_joint", "right_hand_thumb_MCP_joint", "right_hand_thumb_IP_joint"),
    lower=-0.47,
    upper=0.0,
    stiffness=1e3,
    damping=1e2,
    force_limit=20.0,
    mimic=True,
    multipliers=(1.0, 4 / 3, 2 / 3),
    offsets=(0.0, -0.0814487, -0.0407243),
    reset_noise=False,
)
INDEX = JointGroup(
    ("right_hand_index_MCP_joint", "right_hand_index_PIP_joint"),
    lower=-1.33,
    upper=0.0,
    stiffness=1e3,
    damping=1e2,
    force_limit=20.0,
    mimic=True,
    multipliers=(1.0, 1.06399),
    offsets=(0.0, -0.167348),
    reset_noise=False,
)
LINKS = (
    "right_hand_wrist_base_link",
    "right_hand_wrist_link",
    "right_hand_hand_base_link",
    "right_hand_thumb_metacarpal_base",
    "right_hand_thumb_metacarpal",
    "right_hand_thumb_proximal",
    "right_hand_thumb_distal",
    "right_hand_index_proximal",
    "right_hand_index_middle",
    "right_hand_middle_proximal",
    "right_hand_middle_middle",
    "right_hand_ring_proximal",
    "right_hand_ring_middle",
    "right_hand_pinky_proximal",
    "right_hand_pinky_middle",
)
GRIPPING = (LINKS[2], *LINKS[4:])  # from the palm on

FIXED_INSPIRE_HAND_RIGHT = RobotDescriptor(
    name="fixed_inspire_hand_right",
    urdf=UrdfLocator("maniskill_inspire_hand", "RH56DFX-2LR/urdf/inspire_hand_right.urdf"),
    action_split=ActionSplit(
        wrist=WRIST,
        thumb_turn=THUMB_TURN,
        thumb=THUMB,
        index=INDEX,
        middle=replace(
            INDEX, joints=("right_hand_middle_MCP_joint", "right_hand_middle_PIP_joint")
        ),
        ring=replace(INDEX, joints=("right_hand_ring_MCP_joint", "right_hand_ring_PIP_joint")),
        pinky=replace(INDEX, joints=("right_hand_pinky_MCP_joint", "right_hand_pinky_PIP_joint")),
    ),
    tcp_link="right_hand_thumb_tip",
    tcp_position_links=("right_hand_thumb_tip", "right_hand_index_tip"),
    gripper_material=GripperMaterial(GRIPPING, 2.0, 2.0, 0.0, patch_radius=0.1),
    keyframes={"rest": (0, 0, 0, 0, -0.0814487, -0.0407243, *(0, -0.167348) * 4)},
    home=Home((0.0, 0.0, 0.4), (cos(pi / 4), 0.0, 0.0, -sin(pi / 4))),
    reach=0.14,  # of the thumb's and the first finger's tips, from the URDF
    source="mani_skill 3.0.1, agents/robots/inspire_hand/fixed_inspire_hand.py",
    allowed_collisions=among(  # as ManiSkill, which lets the hand overlap
        LINKS
    ),
)
