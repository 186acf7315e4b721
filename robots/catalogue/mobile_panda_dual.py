"""Two Pandas on a mobile base that stands still: 2 × (7 + 1) + 1 numbers. Cannot be drawn."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.mobile_panda import BASE, LIFT, MOBILE_PANDA
from robots.catalogue.panda import ARM, PANDA
from robots.descriptor import ActionSplit, Fingers, GripperMaterial, Limb, names
from robots.parts import among, both_sides

LEFT = ("left_panda_leftfinger", "left_panda_rightfinger")
FINGERS = (*LEFT, "right_panda_leftfinger", "right_panda_rightfinger")
GRIPPER = PANDA.action_split.groups["gripper"]

MOBILE_PANDA_DUAL = replace(
    MOBILE_PANDA,
    name="mobile_panda_dual",
    urdf=UrdfLocator("maniskill_panda", "mobile_panda_dual_arm.urdf"),
    action_split=ActionSplit(
        left_arm=replace(ARM, joints=names("left_panda_joint", 1, 7)),
        left_gripper=replace(GRIPPER, joints=names("left_panda_finger_joint", 1, 2)),
        right_arm=replace(ARM, joints=names("right_panda_joint", 1, 7)),
        right_gripper=replace(GRIPPER, joints=names("right_panda_finger_joint", 1, 2)),
        lift=LIFT,
        base_slide=replace(BASE, joints=("root_x_axis_joint", "root_y_axis_joint"), unit="m"),
        base_turn=BASE,
    ),
    tcp_link="left_panda_hand_tcp",
    gripper_material=GripperMaterial(FINGERS, 2.0, 2.0, 0.0, patch_radius=0.1),
    fingers=Fingers(LEFT),
    limbs=both_sides(Limb("left_panda_hand_tcp", 0.947, (0.0808, 0.3012, 0.42), Fingers(LEFT))),
    allowed_collisions=among(
        ("left_panda_link7", "left_panda_hand"), ("right_panda_link7", "right_panda_hand")
    ),
    keyframes={"rest": (*PANDA.keyframe("rest") * 2, 0.0, 0, 0, 0)},
)
