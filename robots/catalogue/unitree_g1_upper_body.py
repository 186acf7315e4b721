"""Unitree G1 on legs that stand still: 5 + 7 numbers for each arm and hand, and 1 for its torso."""

from robots.assets.locator import UrdfLocator
from robots.descriptor import ActionSplit, GripperMaterial, Home, JointGroup, RobotDescriptor
from robots.link_pairs import among
from robots.parts import both_sides

SIDES = ("left", "right")
ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow_pitch", "elbow_roll")
HAND = ("zero", "one", "two", "three", "four", "five", "six")
CLOSE = ("one", "three", "four", "five", "six", "palm", "elbow_roll")  # overlap, harmlessly
THUMB = ((-0.523598, 0.523598), (-1.0, 1.2), (0.0, 1.84))
BENDS = ((-1.84, 0.3), (-1.84, 0.0))  # of a finger
Limits = tuple[tuple[float, float], ...]
LIMITS: dict[str, Limits] = {
    "arm": ((-2.9671, 2.7925), (-1.5882, 2.2515), (-2.618, 2.618), (-0.2268, 3.4208),
            (-2.0943, 2.0943)),
    "hand": (*THUMB, *BENDS, *BENDS),
}  # fmt: skip


def group(side: str, parts: tuple[str, ...], limits: Limits, step: float) -> JointGroup:
    """Return joints of one side (step: rad); the right side is the left one in a mirror."""
    turned = ("shoulder_roll", *HAND[1:])
    if side == "right":
        pairs = zip(parts, limits, strict=True)
        limits = tuple((-b, -a) if part in turned else (a, b) for part, (a, b) in pairs)
    joints = tuple(f"{side}_{part}_joint" for part in parts) if side else parts
    return JointGroup(joints, -step, step, 1e3, 1e2, 100.0, delta=True, limits=limits)


UNITREE_G1_UPPER_BODY = RobotDescriptor(
    name="unitree_g1_upper_body",  # ManiSkill: unitree_g1_simplified_upper_body
    urdf=UrdfLocator("maniskill_g1_humanoid", "g1_simplified_upper_body.urdf"),
    action_split=ActionSplit(
        left_arm=group("left", ARM, LIMITS["arm"], 0.2),
        left_gripper=group("left", HAND, LIMITS["hand"], 0.5),
        right_arm=group("right", ARM, LIMITS["arm"], 0.2),
        right_gripper=group("right", HAND, LIMITS["hand"], 0.5),
        torso=group("", ("torso_joint",), ((-2.618, 2.618),), 0.2),
    ),
    tcp_link="left_tcp_link",
    gripper_material=GripperMaterial(
        tuple(f"{side}_{part}_link" for side in SIDES for part in (*HAND[1:], "palm")),
        2.0,
        2.0,
        0.0,
        patch_radius=0.1,
    ),  # fmt: skip
    keyframes={"standing": (0,) * 25, "rest": (0,) * 25},
    home=Home(position=(0.0, 0.0, 0.755)),
    limbs=both_sides("{side}_tcp_link", 0.531, (-0.0025, 0.104, 0.2593)),
    reach=0.64,  # of the left TCP, from the URDF
    source="mani_skill 3.0.1, agents/robots/unitree_g1/g1_upper_body.py",
    allowed_collisions=among(
        *(tuple(f"{side}_{part}_link" for part in CLOSE) for side in SIDES),
        ("torso_link", "left_shoulder_roll_link", "right_shoulder_roll_link"),
    ),
)
