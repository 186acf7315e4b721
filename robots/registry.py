"""Which robots there are: the built-in catalogue, registered descriptors, and entry points."""

from __future__ import annotations

from robot_layouts.core.catalogue import Catalogue
from robot_layouts.core.errors import DescriptorError, RobotLayoutsError
from robot_layouts.core.quoting import shown
from robots.descriptor import RobotDescriptor

# One name per robot, sorted: that of its module, and in capitals that of its descriptor.
NAMES = (
    "ability_hand_left",
    "ability_hand_right",
    "allegro_hand_left",
    "allegro_hand_right",
    "baxter",
    "dclaw",
    "fetch",
    "fetch_driving",
    "fixed_inspire_hand_left",
    "fixed_inspire_hand_right",
    "floating_ability_hand_left",
    "floating_ability_hand_right",
    "floating_inspire_hand_left",
    "floating_inspire_hand_right",
    "floating_panda_gripper",
    "franka_panda",
    "jaco2",
    "koch",
    "mobile_panda",
    "mobile_panda_dual",
    "panda",
    "panda_pinch",
    "panda_stick",
    "panda_wristcam",
    "pr2",
    "so100",
    "so101",
    "talos",
    "talos_left_arm",
    "tiago",
    "tiago_pro",
    "trifingerpro",
    "unitree_g1",
    "unitree_g1_simplified_upper_body_with_head_camera",
    "unitree_g1_upper_body",
    "unitree_g1_upper_body_head_camera",
    "unitree_g1_upper_body_right_arm",
    "unitree_g1_with_hands",
    "ur10",
    "ur3",
    "ur3_gripper",
    "ur5",
    "ur5_gripper",
    "xarm7",
    "xarm7_ability",
    "z1",
)
CATALOGUE = {name: f"robots.catalogue.{name}:{name.upper()}" for name in NAMES}


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
        ROBOTS.add(checked_robot(descriptor, "register").name, descriptor)
        return descriptor
