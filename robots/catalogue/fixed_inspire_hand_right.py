"""Inspire RH56DFX right hand on its wrist, five fingers: 2 + 6 action numbers."""

from dataclasses import replace
from math import cos, pi, sin

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, GripperMaterial, Home, JointGroup, RobotDescriptor
from robots.link_pairs import among

FINGERS = ("index", "middle", "ring", "pinky")
THUMB = ("metacarpal_base", "metacarpal", "proximal", "distal")
SWING = ((-0.3954916, 0.38606682), (-0.44505897, 0.44505897))  # of the wrist


def hand(side: str) -> RobotDescriptor:
    """Return a hand; it is ``left`` or ``right``."""
    hand = f"{side}_hand"
    turn = JointGroup(
        (f"{hand}_thumb_CMC_yaw_joint",), -0.1, 0.1, 1e3, 1e2, 20.0, delta=True,
        limits=((-1.3089969, 0.0),),
    )  # fmt: skip
    wrist = tuple(f"{hand}_wrist_{way}_joint" for way in ("pitch", "yaw"))
    # The joints that follow are driven like those they follow, as the URDF couples them.
    bend = JointGroup(
        tuple(f"{hand}_thumb_{joint}_joint" for joint in ("CMC_pitch", "MCP", "IP")),
        -0.47, 0.0, 1e3, 1e2, 20.0, mimic=True, reset_noise=False,
        multipliers=(1.0, 4 / 3, 2 / 3), offsets=(0.0, -0.0814487, -0.0407243),
    )  # fmt: skip
    groups = {"wrist": replace(turn, joints=wrist, force_limit=100.0, limits=SWING)}
    groups |= {"thumb_turn": turn, "thumb": bend}
    for name in FINGERS:
        joints = (f"{hand}_{name}_MCP_joint", f"{hand}_{name}_PIP_joint")
        ratios, offsets = (1.0, 1.06399), (0.0, -0.167348)
        groups[name] = replace(
            bend, joints=joints, lower=-1.33, multipliers=ratios, offsets=offsets
        )
    links = tuple(f"{hand}_thumb_{part}" for part in THUMB)
    links += tuple(f"{hand}_{name}_{part}" for name in FINGERS for part in ("proximal", "middle"))
    palm = (f"{hand}_wrist_base_link", f"{hand}_wrist_link", f"{hand}_hand_base_link")
    return RobotDescriptor(
        name=f"fixed_inspire_hand_{side}",
        urdf=UrdfLocator("maniskill_inspire_hand", f"RH56DFX-2LR/urdf/inspire_hand_{side}.urdf"),
        action_split=ActionSplit(**groups),
        tcp_link=f"{hand}_thumb_tip",
        tcp_position_links=(f"{hand}_thumb_tip", f"{hand}_index_tip"),
        gripper_material=GripperMaterial((palm[2], *links[1:]), 2.0, 2.0, 0.0, patch_radius=0.1),
        keyframes={"rest": (0, 0, 0, 0, -0.0814487, -0.0407243, *(0, -0.167348) * 4)},
        home=Home((0.0, 0.0, 0.4), (cos(pi / 4), 0.0, 0.0, -sin(pi / 4))),
        reach=0.14,  # of the thumb's and the first finger's tips, from the URDF
        source="mani_skill 3.0.1, agents/robots/inspire_hand/fixed_inspire_hand.py",
        allowed_collisions=among((*palm, *links)),  # as ManiSkill, which lets the hand overlap
    )


FIXED_INSPIRE_HAND_RIGHT = hand("right")
