"""A UR5 with a Robotiq 2F-140, whose files the wheel of robosuite brings (MIT).

    pip install --no-deps robosuite==1.5.2
    robot-layouts tasks view PickCube-v1 --robots arm=robotiq:UR5_WITH_ROBOTIQ

The file says nothing of its linkage but springs, so it is declared here: six joints, one number.
"""

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from robots import ActionSplit, AssetError, Fingers, JointGroup, RobotDescriptor, RobotRegistry
from robots.grafting import with_gripper

SIDES = "left", "right"
LINKAGE = JointGroup(
    (
        *("finger_joint", "left_inner_finger_joint", "left_inner_knuckle_joint"),
        *("right_outer_knuckle_joint", "right_inner_finger_joint", "right_inner_knuckle_joint"),
    ),
    lower=-0.7,  # closed
    upper=0.0,
    stiffness=400.0,
    damping=40.0,
    force_limit=12.5,  # 125 N, the most that it grips with, on a lever of 0.1 m
    mimic=True,
    multipliers=(-1.0, -1.0, 1.0, 1.0, -1.0, 1.0),
    leaders=("finger_joint", "right_outer_knuckle_joint"),
    lead=0.1,
    armature=0.01,
    reset_noise=False,
)


def robotiq_140() -> RobotDescriptor:
    """Return the gripper: one action number, 1 is open.

    Raises:
        AssetError: If robosuite is not installed.
    """
    if (found := find_spec("robosuite")) is None or found.origin is None:
        raise AssetError("its files lack: pip install --no-deps robosuite==1.5.2")
    folder = Path(found.origin).parent / "models/assets/grippers"
    guess = RobotDescriptor.from_mjcf(folder / "robotiq_gripper_140.xml", "robotiq_140", quiet=True)
    crossing = [(f"{side}_inner_finger", f"{side}_inner_knuckle") for side in SIDES]
    return replace(
        guess,
        action_split=ActionSplit(gripper=LINKAGE),
        fingers=Fingers(
            ("left_inner_finger", "right_inner_finger"), (1, 1), opening_axes=((0, 0, 1), (0, 0, 1))
        ),
        tcp_link="grip_site",
        tcp_offset=(0.0, 0.0, 0.025),  # near the ends of the pads
        keyframes={"rest": (0.0,) * 6},
        allowed_collisions=tuple(dict.fromkeys((*(guess.allowed_collisions or ()), *crossing))),
    )


UR5_WITH_ROBOTIQ = with_gripper(RobotRegistry.load("ur5"), robotiq_140())
