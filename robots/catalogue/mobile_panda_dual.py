"""Two Pandas on a mobile base that stands still: 2 × (7 + 1) + 1 numbers. Cannot be drawn."""

from dataclasses import replace

from robots.assets.locator import UrdfLocator
from robots.catalogue.mobile_panda import BASE, LIFT, MOBILE_PANDA
from robots.catalogue.panda import ARM, PANDA
from robots.descriptor import ActionSplit, Fingers, GripperMaterial, JointGroup, names
from robots.link_pairs import among
from robots.parts import both_sides

LEFT = ("left_panda_leftfinger", "left_panda_rightfinger")
FINGERS = (*LEFT, "right_panda_leftfinger", "right_panda_rightfinger")


def gripper(side: str) -> JointGroup:
    """Return one hand's fingers."""
    joints = names(f"{side}_panda_finger_joint", 1, 2)
    return replace(PANDA.action_split.groups["gripper"], joints=joints)


MOBILE_PANDA_DUAL = replace(
    MOBILE_PANDA,
    name="mobile_panda_dual",
    urdf=UrdfLocator("maniskill_panda", "mobile_panda_dual_arm.urdf"),
    action_split=ActionSplit(
        left_arm=replace(ARM, joints=names("left_panda_joint", 1, 7)),
        left_gripper=gripper("left"),
        right_arm=replace(ARM, joints=names("right_panda_joint", 1, 7)),
        right_gripper=gripper("right"),
        lift=LIFT,
        base_slide=replace(BASE, joints=("root_x_axis_joint", "root_y_axis_joint"), unit="m"),
        base_turn=BASE,
    ),
    tcp_link="left_panda_hand_tcp",
    gripper_material=GripperMaterial(FINGERS, 2.0, 2.0, 0.0, patch_radius=0.1),
    fingers=Fingers(LEFT),
    limbs=both_sides(
        "{side}_panda_hand_tcp",
        0.947,
        (0.0808, 0.3012, 0.42),
        Fingers(("{side}_panda_leftfinger", "{side}_panda_rightfinger")),
    ),
    allowed_collisions=among(*((f"{s}_panda_link7", f"{s}_panda_hand") for s in ("left", "right"))),
    keyframes={"rest": (*PANDA.keyframe("rest") * 2, 0.0, 0, 0, 0)},
)
