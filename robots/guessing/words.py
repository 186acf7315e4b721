"""What the names of links and joints tell: the generic words of robotics, and sides."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache

BASE = ("root", "world", "dummy", "planar", "virtual", "odom", "odometry", "mobile", "floating")
FINGER = (
    "finger", "thumb", "index", "middle", "ring", "pinky", "little", "knuckle", "phalanx",
    "proximal", "distal", "mcp", "pip", "dip", "gripper", "jaw", "claw", "pincer", "hand",
    "pad", "palm", "fingertip",
)  # fmt: skip
JAW = ("gripper", "jaw", "finger", "fngr", "claw", "pincer", "knuckle", "clamp")
WRIST = ("wrist", "roll", "yaw", "pitch", "rotate", "rotation", "flex")
HEAD = (
    "head", "neck", "eye", "gaze", "camera", "cam", "laser", "lidar", "velodyne", "sensor",
    "screen", "face", "mouth", "cervical", "antenna", "kinect",
)  # fmt: skip
LEG = (
    "leg", "hip", "thigh", "knee", "calf", "ankle", "foot", "toe", "shank", "shin", "femur",
    "tibia", "coxa", "haa", "hfe", "kfe", "upperleg", "lowerleg", "sole", "hipz",
)  # fmt: skip
WHEEL = (
    "wheel",
    "caster",
    "castor",
    "roller",
    "suspension",
    "steering",
    "steer",
    "track",
    "rotor",
    "propeller",
)
TORSO = ("torso", "waist", "spine", "trunk", "chest", "lumbar", "thoracic", "lift", "column")
ARM = ("arm", "shoulder", "elbow", "wrist", "forearm", "upperarm", "lowerarm", "clavicle")
TCP = ("tcp",)
GRASP = ("grasp", "grasping", "grasptarget", "pinch", "grip")
TOOL = ("tool", "tip", "nozzle", "suction", "vacuum", "cup")
END = ("ee", "eef", "endeffector", "effector")
HAND = ("gripper", "hand")
FLANGE = ("flange", "attachment")
TIP = ("tip", "fingertip")

LEFT = ("left", "l", "lf", "lh")
RIGHT = ("right", "r", "rf", "rh")


@lru_cache(maxsize=4096)
def words(name: str) -> tuple[str, ...]:
    """Return the words of a name in lower case, without numbers at their ends.

    Humps part words as underscores do: ``LHipYaw`` is ``l``, ``hip``, ``yaw``.
    """
    apart = re.sub(r"([A-Z])([A-Z][a-z])|([a-z0-9])([A-Z])", r"\1\3_\2\4", name)
    parts = re.split(r"[^a-z0-9]+", apart.lower())
    return tuple(re.sub(r"(?<=[a-z])\d+$", "", part) for part in parts if part)


@lru_cache(maxsize=4096)
def has(name: str, known: tuple[str, ...]) -> bool:
    """Tell whether a name holds one of some words, alone or behind the letter of a side."""
    found = words(name)
    spelled = {side + word for word in known if len(word) > 2 for side in ("l", "r")}
    if not spelled.union(known).isdisjoint(found):
        return True
    joined = "".join(found)
    return any([len(word) > 4 and word in joined for word in known])


def is_tool(name: str) -> bool:
    """Tell whether a link is named like the end of an arm, such as ``tool0`` or ``ee_link``."""
    return has(name, END) or "end_effector" in "_".join(words(name)) or "tool" in words(name)


def side(names: Iterable[str]) -> str:
    """Return ``"left"`` or ``"right"``, as most names say by their first word that does, or ""."""
    votes = [vote for name in names if (vote := _side(name))]
    left, right = votes.count("left"), votes.count("right")
    return "" if left == right else "left" if left > right else "right"


def _side(name: str) -> str:
    for part in words(name):
        for label, known in (("left", LEFT), ("right", RIGHT)):
            marked = part.startswith((label, *(f"{known[1]}{word}" for word in (*ARM, *HAND))))
            if part in known or marked or part.endswith(label):
                return label
    return ""
