"""Inspire RH56DFX right hand on its wrist, five fingers: 2 + 6 action numbers."""

from math import cos, pi, sin

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, GripperMaterial, Home, JointGroup, RobotDescriptor
from robots.link_pairs import among

FINGERS = ("index", "middle", "ring", "pinky")
THUMB = ("metacarpal_base", "metacarpal", "proximal", "distal")
THIRD = 4 / 3  # from the thumb's root to its middle joint


def hand(side: str) -> RobotDescriptor:
    """Return a hand; it is ``left`` or ``right``."""
    hand = f"{side}_hand"
    drive = {"stiffness": 1e3, "damping": 1e2, "force_limit": 20.0}
    small = {"lower": -0.1, "upper": 0.1, "delta": True, **drive}
    wrist = tuple(f"{hand}_wrist_{way}_joint" for way in ("pitch", "yaw"))
    swing = ((-0.39549160850191506, 0.3860668305411457), (-0.445058959258554, 0.445058959258554))
    thumb = tuple(f"{hand}_thumb_{joint}_joint" for joint in ("CMC_pitch", "MCP", "IP"))
    turn = JointGroup((f"{hand}_thumb_CMC_yaw_joint",), limits=((-1.3089969, 0.0),), **small)
    # The joints that follow are driven like those they follow, as the URDF couples them.
    ratios = {"multipliers": (1, THIRD, THIRD / 2), "offsets": (0, -0.0814487, -0.0407243)}
    bend = JointGroup(thumb, -0.47, 0.0, mimic=True, reset_noise=False, **ratios, **drive)
    groups = {"wrist": JointGroup(wrist, limits=swing, **{**small, "force_limit": 100.0})}
    groups |= {"thumb_turn": turn, "thumb": bend}
    for name in FINGERS:
        joints = (f"{hand}_{name}_MCP_joint", f"{hand}_{name}_PIP_joint")
        ratios = {"multipliers": (1.0, 1.06399), "offsets": (0.0, -0.167348)}
        groups[name] = JointGroup(joints, -1.33, 0.0, mimic=True, reset_noise=False,
                                  **ratios, **drive)  # fmt: skip
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
