"""Names of links, joints and frames in one ROS 2 description: each robot's behind its place."""

from __future__ import annotations

from layouts.export.cell import ExportedCell, Tool
from layouts.export.names import Names

WORLD = "world"


class RosNames:
    """Which name everything of a cell has; no two links, and no two joints, have the same.

    Attributes:
        frames: Of the layout's frames, as links.
        systems: Of what drives the robot in each place.
    """

    def __init__(self, cell: ExportedCell) -> None:
        """Name everything."""
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
        self._fixed = {link: joints.new(f"{link}_fixed") for link in self._more(cell)}

    def _more(self, cell: ExportedCell) -> tuple[str, ...]:
        roots = [self.link(n, standing.source.model.root) for n, standing in cell.robots.items()]
        return (*roots, *self._tools.values(), *self.frames.values())

    def link(self, place: str, link: str) -> str:
        """Return the name of a robot's link."""
        return self._links[place, link]

    def joint(self, place: str, joint: str) -> str:
        """Return the name of a robot's joint."""
        return self._joints[place, joint]

    def tool(self, tool: Tool) -> str:
        """Return the name of the link at a tool centre point."""
        return self._tools[tool.arm]

    def fixed_joint(self, link: str) -> str:
        """Return the name of the joint that fixes a root, a tool centre point or a frame.

        Args:
            link: Its name here.
        """
        return self._fixed[link]
