"""Which robots there are: the built-in catalogue, registered descriptors, and entry points."""

from __future__ import annotations

from robots.common.catalogue import Catalogue
from robots.common.errors import DescriptorError, RobotLayoutsError
from robots.common.quoting import shown
from robots.descriptor import RobotDescriptor

# One line per robot, sorted by name: name -> module:attribute.
CATALOGUE = {
    "ability_hand_left": "robots.catalogue.ability_hand_left:ABILITY_HAND_LEFT",
    "ability_hand_right": "robots.catalogue.ability_hand_right:ABILITY_HAND_RIGHT",
    "allegro_hand_left": "robots.catalogue.allegro_hand_left:ALLEGRO_HAND_LEFT",
    "allegro_hand_right": "robots.catalogue.allegro_hand_right:ALLEGRO_HAND_RIGHT",
    "baxter": "robots.catalogue.baxter:BAXTER",
    "dclaw": "robots.catalogue.dclaw:DCLAW",
    "fetch": "robots.catalogue.fetch:FETCH",
    "fetch_driving": "robots.catalogue.fetch_driving:FETCH_DRIVING",
    "fixed_inspire_hand_left": "robots.catalogue.fixed_inspire_hand_left:FIXED_INSPIRE_HAND_LEFT",
    "fixed_inspire_hand_right": (
        "robots.catalogue.fixed_inspire_hand_right:FIXED_INSPIRE_HAND_RIGHT"
    ),
    "floating_ability_hand_left": (
        "robots.catalogue.floating_ability_hand_left:FLOATING_ABILITY_HAND_LEFT"
    ),
    "floating_ability_hand_right": (
        "robots.catalogue.floating_ability_hand_right:FLOATING_ABILITY_HAND_RIGHT"
    ),
    "floating_inspire_hand_left": (
        "robots.catalogue.floating_inspire_hand_left:FLOATING_INSPIRE_HAND_LEFT"
    ),
    "floating_inspire_hand_right": (
        "robots.catalogue.floating_inspire_hand_right:FLOATING_INSPIRE_HAND_RIGHT"
    ),
    "floating_panda_gripper": "robots.catalogue.floating_panda_gripper:FLOATING_PANDA_GRIPPER",
    "franka_panda": "robots.catalogue.franka_panda:FRANKA_PANDA",
    "jaco2": "robots.catalogue.jaco2:JACO2",
    "koch": "robots.catalogue.koch:KOCH",
    "mobile_panda": "robots.catalogue.mobile_panda:MOBILE_PANDA",
    "mobile_panda_dual": "robots.catalogue.mobile_panda_dual:MOBILE_PANDA_DUAL",
    "panda": "robots.catalogue.panda:PANDA",
    "panda_pinch": "robots.catalogue.panda_pinch:PANDA_PINCH",
    "panda_stick": "robots.catalogue.panda_stick:PANDA_STICK",
    "panda_wristcam": "robots.catalogue.panda_wristcam:PANDA_WRISTCAM",
    "pr2": "robots.catalogue.pr2:PR2",
    "so100": "robots.catalogue.so100:SO100",
    "so101": "robots.catalogue.so101:SO101",
    "talos": "robots.catalogue.talos:TALOS",
    "talos_left_arm": "robots.catalogue.talos_left_arm:TALOS_LEFT_ARM",
    "tiago": "robots.catalogue.tiago:TIAGO",
    "tiago_pro": "robots.catalogue.tiago_pro:TIAGO_PRO",
    "trifingerpro": "robots.catalogue.trifingerpro:TRIFINGERPRO",
    "unitree_g1": "robots.catalogue.unitree_g1:UNITREE_G1",
    "unitree_g1_upper_body": "robots.catalogue.unitree_g1_upper_body:UNITREE_G1_UPPER_BODY",
    "unitree_g1_upper_body_head_camera": (
        "robots.catalogue.unitree_g1_upper_body_head_camera:UNITREE_G1_UPPER_BODY_HEAD_CAMERA"
    ),
    "unitree_g1_upper_body_right_arm": (
        "robots.catalogue.unitree_g1_upper_body_right_arm:UNITREE_G1_UPPER_BODY_RIGHT_ARM"
    ),
    "unitree_g1_with_hands": "robots.catalogue.unitree_g1_with_hands:UNITREE_G1_WITH_HANDS",
    "ur10": "robots.catalogue.ur10:UR10",
    "ur3": "robots.catalogue.ur3:UR3",
    "ur3_gripper": "robots.catalogue.ur3_gripper:UR3_GRIPPER",
    "ur5": "robots.catalogue.ur5:UR5",
    "ur5_gripper": "robots.catalogue.ur5_gripper:UR5_GRIPPER",
    "xarm7": "robots.catalogue.xarm7:XARM7",
    "xarm7_ability": "robots.catalogue.xarm7_ability:XARM7_ABILITY",
    "z1": "robots.catalogue.z1:Z1",
}


def checked_robot(given: object, origin: str, name: str | None = None) -> RobotDescriptor:
    """Return a descriptor that came from elsewhere, if it is one and goes by its name.

    Raises:
        DescriptorError: If not.
    """
    if not isinstance(given, RobotDescriptor):
        raise DescriptorError(
            f"{origin} gave {shown(given)}, of type {type(given).__name__};"
            " a RobotDescriptor is needed"
        )
    if name is not None and given.name != name:
        raise DescriptorError(f"{origin} is listed as {name!r}, but its robot is {given.name!r}")
    return given


ROBOTS = Catalogue(
    "robot",
    CATALOGUE,
    group="robot_layouts.robots",
    check=checked_robot,
    error=DescriptorError,
    hint="`robot-layouts robots list` has all; RobotRegistry.register(descriptor) adds your own.",
)


class RobotRegistry:
    """The names under which robots are known in this process."""

    @staticmethod
    def load(name: str) -> RobotDescriptor:
        """Return the descriptor registered under ``name``, touching none of its files.

        Looks at descriptors registered in this process, then at the built-in catalogue, then at
        the entry points ``robot_layouts.robots`` of installed packages.

        Raises:
            UnknownNameError: If no robot has that name (also a ``KeyError``).
            DescriptorError: If another package brings the robot, and that goes wrong.
        """
        if not isinstance(name, str):
            kind = f"of type {type(name).__name__}"
            raise ROBOTS.unknown(kind, "It takes a robot's name.")
        return ROBOTS[name]

    @staticmethod
    def names() -> tuple[str, ...]:
        """Return every robot name, sorted."""
        return tuple(ROBOTS)

    @staticmethod
    def load_all() -> tuple[list[RobotDescriptor], list[RobotLayoutsError]]:
        """Return every robot, sorted by name, and why those of other packages that fail do so."""
        return ROBOTS.load_all()

    @staticmethod
    def register(descriptor: RobotDescriptor) -> RobotDescriptor:
        """Make a descriptor loadable by its name in this process, and return it.

        Registering the same descriptor again is allowed.

        Raises:
            DescriptorError: If it is no descriptor, or another robot has that name.
        """
        name = checked_robot(descriptor, "register").name
        if name in ROBOTS and ROBOTS[name] != descriptor:
            raise DescriptorError(
                f"another robot is already called {name!r};"
                " choose another name with dataclasses.replace(descriptor, name=...)"
            )
        ROBOTS.register(name, descriptor)
        return descriptor
