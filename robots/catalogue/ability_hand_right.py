"""PSYONIC Ability Hand, right, five fingers: 4 + 2 action numbers."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, GripperMaterial, Home, JointGroup, RobotDescriptor

FRONT = ("thumb_L2", "index_L2", "middle_L2", "ring_L2", "pinky_L2")
TIPS = ("thumb_tip", "index_tip", "middle_tip", "ring_tip", "pinky_tip")
INDEX = JointGroup(
    ("index_q1", "index_q2"),  # the second follows the first
    mimic=True,
    multipliers=(1.0, 1.05851325),
    offsets=(0.0, 0.72349796),
    lower=0.0,
    upper=1.828,  # where the second joint ends
    stiffness=1e3,
    damping=1e2,
    force_limit=50.0,
    reset_noise=False,
)
FINGERS = {
    "index": INDEX,
    "middle": replace(INDEX, joints=("middle_q1", "middle_q2")),
    "ring": replace(INDEX, joints=("ring_q1", "ring_q2")),
    "pinky": replace(INDEX, joints=("pinky_q1", "pinky_q2")),
}
THUMB = JointGroup(
    ("thumb_q1", "thumb_q2"),
    lower=-0.1,
    upper=0.1,
    delta=True,
    stiffness=1e3,
    damping=1e2,
    force_limit=50.0,
    limits=((-2.0943951, 0.0), (0.0, 2.0943951)),
)

ABILITY_HAND_RIGHT = RobotDescriptor(
    name="ability_hand_right",
    urdf=UrdfLocator("maniskill_ability_hand", "ability_hand_right.urdf"),
    action_split=ActionSplit(**FINGERS, thumb=THUMB),
    tcp_link="thumb_tip",
    tcp_position_links=("thumb_tip", "index_tip"),
    gripper_material=GripperMaterial(FRONT, 2.0, 1.5, 0.0, patch_radius=0.05),
    keyframes={"rest": (*(0, 0.72349796) * 4, 0, 0)},
    home=Home(position=(0.0, 0.0, 0.3)),
    reach=0.09,  # of the thumb's and the first finger's tips, from the URDF
    source="mani_skill 3.0.1, agents/robots/floating_ability_hand/floating_ability_hand.py",
)
