"""Panda on the side of a mobile base that stands still: 7 + 1 + 1 numbers. Cannot be drawn."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.panda import ARM, PANDA
from robots.descriptor import ActionSplit, Fingers, GripperMaterial, Home, JointGroup, names
from robots.parts import among

FINGERS = ("right_panda_leftfinger", "right_panda_rightfinger")
# ManiSkill has files of this robot and no agent. The lift carries 20 kg, or twice that.
LIFT = JointGroup(
    ("linear_actuator_height",),
    unit="m",
    lower=-0.02,
    upper=0.02,
    delta=True,
    stiffness=1e5,
    damping=1e4,
    force_limit=1e4,
    reset_noise=False,
    limits=((0.0, 1.6),),
)
BASE = JointGroup.hold(("root_z_rotation_joint",), stiffness=1e5, damping=1e5, force_limit=1e5)

MOBILE_PANDA = replace(
    PANDA,
    name="mobile_panda",
    urdf=UrdfLocator("maniskill_panda", "mobile_panda_single_arm.urdf"),
    action_split=ActionSplit(
        arm=replace(ARM, joints=names("right_panda_joint", 1, 7)),
        gripper=replace(
            PANDA.action_split.groups["gripper"], joints=names("right_panda_finger_joint", 1, 2)
        ),
        lift=LIFT,
        base_slide=replace(BASE, joints=("root_x_axis_joint", "root_y_axis_joint"), unit="m"),
        base_turn=BASE,
    ),
    tcp_link="right_panda_hand_tcp",
    gripper_material=GripperMaterial(FINGERS, 2.0, 2.0, 0.0, patch_radius=0.1),
    fingers=Fingers(FINGERS),
    keyframes={"rest": (*PANDA.keyframe("rest"), 0.0, 0, 0, 0)},
    home=Home(position=(-1.05, 0.0, -0.9196429)),  # on the floor, where Fetch stands
    allowed_collisions=among(("right_panda_link7", "right_panda_hand")),
    # The column of its lift begins 1.6 m below the floor.
    no_floor_contact=("body_base_link", "adjustable_body"),
    reach=1.26,  # of the TCP, from the URDF
    source="mani_skill 3.0.1, agents/robots/panda/panda.py and agents/robots/fetch/fetch.py",
)
