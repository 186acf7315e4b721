"""Planning groups of a cell: of each arm, gripper and limb, of each place, and of all together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from layouts.export.cell import ExportedCell, Tool
from layouts.export.names import Names
from layouts.export.ros2.names import RosNames
from robots import RobotDescriptor
from robots.action_split import is_gripper
from robots.parts import BODY
from robots.urdf.model import ModelJoint

ALL = "all"


@dataclass(frozen=True)
class Group:
    """A planning group.

    Attributes:
        name: Its name.
        place: The robot's place; empty if it is of several.
        joints: Joints of its own, by their names in the robot's URDF; empty if it is made of
            others. Those that follow another joint are among them.
        driven: Those of them that follow none.
        groups: Groups that it is made of.
        chain: First and last link of a chain of which all joints are its own, as ROS knows them.
        parent: Of a gripper the group that carries it, or empty.
        carrier: Of a gripper the link that carries it, as ROS knows it.
    """

    name: str
    place: str
    joints: tuple[str, ...] = ()
    driven: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    chain: tuple[str, str] | None = None
    parent: str = ""
    carrier: str = ""

    @property
    def controller(self) -> str:
        """Name of its controller."""
        return f"{self.name}_controller"


class Groups:
    """The planning groups of a cell.

    Attributes:
        own: Those that have joints of their own.
        made: Those that are made of others, after those.
    """

    def __init__(self, cell: ExportedCell, names: RosNames) -> None:
        """Find them."""
        self._cell, self._names, self._taken = cell, names, Names(r"\W")
        self._tools = {tool.arm: tool for tool in cell.tools}
        self.own: list[Group] = []
        self.made: list[Group] = []
        wholes = {place: self._taken.new(place) for place in cell.robots}
        for place, whole in wholes.items():
            self._add_place(place, whole)
        if len(wholes) > 1:
            self.made.append(Group(self._taken.new(ALL), "", groups=tuple(wholes.values())))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all."""
        return tuple(group.name for group in (*self.own, *self.made))

    @property
    def controllers(self) -> tuple[str, ...]:
        """Names of the controllers, one for each group with joints of its own."""
        return tuple(group.controller for group in self.own)

    def joints(self, group: Group) -> list[str]:
        """Return the joints of a group's own that are driven, as ROS knows them."""
        return [self._names.joint(group.place, joint) for joint in group.driven]

    def _add_place(self, place: str, whole: str) -> None:
        arms = [arm for arm in self._cell.layout.parts if arm.partition(".")[0] == place]
        inside: list[str] = []
        for arm in arms:
            limb = arm.partition(".")[2]
            own = self._add_part(arm, place, f"{whole}_{limb}" if limb else whole)
            if limb and limb != BODY and own:
                name = self._taken.new(f"{whole}_{limb}")
                self.made.append(Group(name, place, groups=tuple(own)))
                own = [name]
            inside += own
        self.made.append(Group(whole, place, groups=tuple(inside)))

    def _add_part(self, part: str, place: str, prefix: str) -> list[str]:
        """Add what a robot or limb moves by itself, and return the names of its groups."""
        robot = self._cell.layout.parts[part].robot
        arm, gripper = list(robot.arm_joints), _gripper_joints(robot)
        added: list[Group] = []
        if arm:
            ending = "" if part.endswith(f".{BODY}") else "_arm"
            name = self._taken.new(f"{prefix}{ending}")
            chain = self._chain(self._tools.get(part), place, arm)
            added.append(Group(name, place, *self._moved(place, arm), chain=chain))
        if gripper:
            name, (joints, driven) = (
                self._taken.new(f"{prefix}_gripper"),
                self._moved(place, gripper),
            )
            parent = added[0].name if added else ""
            carrier = self._names.link(place, self._joint(place, joints[0]).parent)
            added.append(Group(name, place, joints, driven, parent=parent, carrier=carrier))
        self.own += added
        return [group.name for group in added]

    def _moved(self, place: str, joints: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return joints with those that follow them, and those that follow none."""
        source = self._cell.robots[place].source
        found = dict.fromkeys(joints)
        waiting = list(source.followers)
        for joint in (*waiting, *reversed(waiting)):  # a follower may lead, too
            if joint.mimics in found:
                found[joint.name] = None
        driven = set(source.leaders)
        return tuple(found), tuple(joint for joint in found if joint in driven)

    def _chain(
        self, tool: Tool | None, place: str, joints: Sequence[str]
    ) -> tuple[str, str] | None:
        """Return the ends of the chain that some joints make towards a tool, if they make one."""
        if tool is None:
            return None
        path = self._cell.robots[place].source.model.path_to(tool.link)
        places = [i for i, joint in enumerate(path) if joint.name in joints]
        if not places or len(places) != len(joints):
            return None
        between = path[places[0] : places[-1] + 1]
        if any(joint.moves and joint.name not in joints for joint in between):
            return None
        last = between[-1].child
        if all(not joint.moves for joint in path[places[-1] + 1 :]):
            return self._names.link(place, between[0].parent), self._names.tool(tool)
        return self._names.link(place, between[0].parent), self._names.link(place, last)

    def _joint(self, place: str, name: str) -> ModelJoint:
        joints: Iterator[ModelJoint] = iter(self._cell.robots[place].source.model.joints)
        return next(joint for joint in joints if joint.name == name)


def _gripper_joints(robot: RobotDescriptor) -> list[str]:
    groups = robot.action_split.groups.items()
    return [
        joint
        for name, group in groups
        if is_gripper(name) and not group.held
        for joint in group.joints
    ]
