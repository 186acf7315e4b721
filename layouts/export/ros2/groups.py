"""Names of a cell in ROS 2, and its planning groups: of arms, grippers, limbs, places, and all."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from layouts.export.bodies import ExportedBody
from layouts.export.cell import ExportedCell, ToolPoint
from layouts.export.files import Names
from robots.action_split import is_gripper
from robots.parts import BODY

WORLD = "world"
ALL = "all"


class RosNames:
    """Which name everything of a cell has; no two links, and no two joints, have the same.

    Attributes:
        frames: Of the layout's frames, as links.
        systems: Of what drives the robot in each place.
        standing: Of a task's bodies that nothing moves, as links.
        moved: Of those that collide and may move, and of the parts that joints move.
    """

    def __init__(self, cell: ExportedCell, bodies: Iterable[ExportedBody] = ()) -> None:
        """Name everything, and some bodies of a task."""
        links, joints = Names(r"\W"), Names(r"\W")
        links.new(WORLD)
        systems = Names(r"\W")
        self.systems = {place: systems.new(place) for place in cell.robots}
        self._links: dict[tuple[str, str], str] = {}
        self._joints: dict[tuple[str, str], str] = {}
        for place, standing in cell.robots.items():
            for link in standing.source.model.links:
                self._links[place, link] = links.new(f"{place}_{link}")
            for joint in standing.source.model.joints:
                self._joints[place, joint.name] = joints.new(f"{place}_{joint.name}")
        self._tools = {tool.arm: links.new(f"{tool.arm}_tcp") for tool in cell.tools}
        self.frames = {name: links.new(name) for name in cell.layout.frames}
        roots = [self.link(n, standing.source.model.root) for n, standing in cell.robots.items()]
        solid = [body for body in bodies if body.collides]
        self.standing = {body.name: links.new(body.name) for body in solid if body.stands}
        self.moved = {
            link.name: links.new(link.name)
            for body in solid
            for link in body.links
            if not body.stands
        }
        fixed = (*roots, *self._tools.values(), *self.frames.values(), *self.standing.values())
        self._fixed = {link: joints.new(f"{link}_fixed") for link in fixed}

    def link(self, place: str, link: str) -> str:
        """Return the name of a robot's link."""
        return self._links[place, link]

    def joint(self, place: str, joint: str) -> str:
        """Return the name of a robot's joint."""
        return self._joints[place, joint]

    def tool(self, tool: ToolPoint) -> str:
        """Return the name of the link at a tool centre point."""
        return self._tools[tool.arm]

    def fixed_joint(self, link: str) -> str:
        """Return the name of the joint that fixes a root, a tool centre point or a frame.

        Args:
            link: Its name here.
        """
        return self._fixed[link]


@dataclass(frozen=True)
class PlanningGroup:
    """A planning group.

    Attributes:
        name: Its name.
        place: The robot's place; empty if it is of several.
        joints: Joints of its own, by their names in the robot's URDF; empty if it is made of
            others. Those that follow another joint are among them.
        driven: Those of them that follow none.
        groups: PlanningGroups that it is made of.
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


class PlanningGroups:
    """The planning groups of a cell.

    Attributes:
        own: Those that have joints of their own.
        made: Those that are made of others, after those.
    """

    def __init__(self, cell: ExportedCell, names: RosNames) -> None:
        """Find them."""
        self._cell, self._names, self._taken = cell, names, Names(r"\W")
        self._tools = {tool.arm: tool for tool in cell.tools}
        self.own: list[PlanningGroup] = []
        self.made: list[PlanningGroup] = []
        wholes = {place: self._taken.new(place) for place in cell.robots}
        for place, whole in wholes.items():
            self._add_place(place, whole)
        if len(wholes) > 1:
            self.made.append(PlanningGroup(self._taken.new(ALL), "", groups=tuple(wholes.values())))

    @property
    def parts(self) -> dict[str, tuple[PlanningGroup, ...]]:
        """The groups with joints of their own that each group is or is made of, by its name."""
        parts: dict[str, tuple[PlanningGroup, ...]] = {group.name: (group,) for group in self.own}
        for group in self.made:
            parts[group.name] = tuple(part for name in group.groups for part in parts[name])
        return parts

    def joints(self, group: PlanningGroup) -> list[str]:
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
                self.made.append(PlanningGroup(name, place, groups=tuple(own)))
                own = [name]
            inside += own
        self.made.append(PlanningGroup(whole, place, groups=tuple(inside)))

    def _add_part(self, part: str, place: str, prefix: str) -> list[str]:
        """Add what a robot or limb moves by itself, and return the names of its groups."""
        robot = self._cell.layout.parts[part].robot
        arm, gripper = list(robot.arm_joints), list[str]()
        for name, group in robot.action_split.groups.items():
            if is_gripper(name) and not group.held:
                gripper += group.joints
        added: list[PlanningGroup] = []
        if arm:
            ending = "" if part.endswith(f".{BODY}") else "_arm"
            name = self._taken.new(f"{prefix}{ending}")
            chain = self._chain(self._tools.get(part), place, arm)
            added.append(PlanningGroup(name, place, *self._moved(place, arm), chain=chain))
        if gripper:
            name = self._taken.new(f"{prefix}_gripper")
            joints, driven = self._moved(place, gripper)
            parent = added[0].name if added else ""
            parents = {j.name: j.parent for j in self._cell.robots[place].source.model.joints}
            carrier = self._names.link(place, parents[joints[0]])
            added.append(PlanningGroup(name, place, joints, driven, parent=parent, carrier=carrier))
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
        self, tool: ToolPoint | None, place: str, joints: Sequence[str]
    ) -> tuple[str, str] | None:
        """Return the ends of the chain that some joints make towards a tool, if they make one."""
        if tool is None:
            return None
        path = self._cell.robots[place].source.model.path_to(tool.link)
        places = [i for i, joint in enumerate(path) if joint.name in joints]
        if not places or len(places) != len(joints):
            return None
        between, beyond = path[places[0] : places[-1] + 1], path[places[-1] + 1 :]
        if any(joint.moves and joint.name not in joints for joint in between):
            return None
        first, last = (
            self._names.link(place, link) for link in (between[0].parent, between[-1].child)
        )
        return first, last if any(joint.moves for joint in beyond) else self._names.tool(tool)
