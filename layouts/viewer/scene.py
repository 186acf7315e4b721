"""The three-dimensional side of a page: meshes, frames, reach and collision shapes."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from layouts.frames import table_outlines
from layouts.viewer.cell import LinkContact, ShownCell, Thing, node
from layouts.visuals import Visual, coarse, simplified
from robot_layouts.core.figures import COLOURS
from robot_layouts.kinematics.rotations import Floats, quaternion_of
from robots.urdf.tree import link_index

# What can be shown and hidden, and whether it is shown at first.
OVERLAYS: Mapping[str, bool] = {
    "meshes": True,
    "frames": True,
    "reach": True,
    "reach sphere": False,
    "collision": False,
}
COARSE = "coarse"  # one more, for quick pictures: hulls, without shine and shadows
TOUCHING = (214, 39, 40)
TABLE_COLOUR = (222, 207, 184)
FRAME_LENGTH = 0.08  # in reaches
BASE_FRAME_LENGTH = 0.2  # in reaches
CIRCLE_POINTS = 97
LIFT = 0.002  # m, of what lies on the floor


class CellScene:
    """A cell drawn on a viser server.

    Nodes are called ``/ROBOT/OVERLAY/…``, ``/(things)/NAME``, ``/(tables)/NAME`` and
    ``/(ways)/ROBOT/…``: no robot's name has brackets.
    """

    def __init__(self, api: Any, cell: ShownCell, drawn: Collection[str] = tuple(OVERLAYS)) -> None:
        """Draw the cell as it starts.

        Args:
            api: The ``scene`` of a viser server.
            cell: What to draw.
            drawn: Those of `OVERLAYS` that can be shown; the fewer, the quicker robots move. With
                `COARSE`, `hurry` chooses between that and the meshes.
        """
        self._api, self._cell, self._drawn = api, cell, drawn
        self._bases: dict[str, Any] = {}
        self._overlays: dict[str, dict[str, Any]] = {name: {} for name in cell.layout}
        self._moving: dict[str, list[tuple[int, Any]]] = {name: [] for name in cell.layout}
        self._touching: dict[tuple[str, str], Any] = {}
        self._things: dict[str, Any] = {}
        self._ways = api.add_frame(node("(ways)"), show_axes=False)
        self._draw_floor()
        for number, name in enumerate(cell.layout):
            colour = _rgb(COLOURS[number % len(COLOURS)])
            self._draw_robot(name, colour)
            self._draw_ways(name, colour)
            self.pose(name, cell.start[name])
        for name, thing in cell.things.items():
            self.draw(name, thing)

    def draw(self, name: str, thing: Thing) -> None:
        """Draw a thing, in the place of one of the same name if there is one."""
        add = _add_plain if COARSE in self._drawn else _add_parts
        self._things[name] = add(self._api, node("(things)", name), thing.parts)
        self.place(name, thing.pose)

    def stand(self, name: str, pose: Floats) -> None:
        """Let a robot's base stand at a pose: position (m, world), quaternion (wxyz), (7,)."""
        base = self._bases[name]
        base.position, base.wxyz = tuple(pose[:3]), tuple(pose[3:])

    def pose(self, name: str, qpos: Floats) -> None:
        """Show a robot at joint positions.

        Args:
            name: The robot.
            qpos: In the descriptor's order, (dof,) (rad, m).
        """
        poses = self._cell.link_poses(name, qpos)
        places = [(tuple(p[:3, 3]), _wxyz(p[:3, :3])) for p in poses]
        for link, handle in self._moving[name]:
            handle.position, handle.wxyz = places[link]

    @property
    def things(self) -> tuple[str, ...]:
        """Names of the things that are drawn."""
        return tuple(self._things)

    def place(self, name: str, pose: Floats) -> None:
        """Show a thing at a pose: position (m, world), quaternion (wxyz), (7,)."""
        handle = self._things[name]
        handle.position, handle.wxyz = tuple(pose[:3]), tuple(pose[3:])

    def show(self, overlay: str, visible: bool, names: Iterable[str] | None = None) -> None:
        """Show or hide one of `OVERLAYS`, of some robots or of all."""
        for name in self._cell.layout if names is None else names:
            self._overlays[name][overlay].visible = visible

    def hurry(self, quick: bool) -> None:
        """Draw robots coarsely and without shadows, or as they are."""
        self.show(COARSE, quick)
        self.show("meshes", not quick)
        self._api.configure_default_lights(cast_shadow=not quick)

    def show_ways(self, visible: bool) -> None:
        """Show or hide the lines of the cell."""
        self._ways.visible = visible

    def mark(self, contacts: Sequence[LinkContact]) -> None:
        """Show the links that overlap in red, and only those."""
        red = {end for c in contacts for end in zip(c.robots, c.links, strict=True)}
        for end, handle in self._touching.items():
            if handle.visible != (end in red):
                handle.visible = end in red

    def aim(self, camera: Any) -> None:
        """Let a camera look at all robots from the front right, from above.

        Args:
            camera: The ``initial_camera`` of a viser server.
        """
        places = np.array([placement.base_position for placement in self._cell.layout.values()])
        middle = (places.min(0) + places.max(0)) / 2 + (0.0, 0.0, 0.2)
        span = float(np.linalg.norm(np.ptp(places, axis=0)))
        reach = max(placement.robot.reach for placement in self._cell.layout.values())
        distance = 0.55 * span + 1.35 * reach
        camera.look_at = tuple(middle)
        camera.position = tuple(middle + distance * np.array([0.9, -0.55, 0.6]))

    def _draw_robot(self, name: str, colour: tuple[int, int, int]) -> None:
        api, placement = self._api, self._cell.layout[name]
        pose = placement.base_pose
        self._bases[name] = api.add_frame(
            f"/{name}", show_axes=False, position=pose.position, wxyz=pose.quaternion
        )
        extra = {COARSE: False} if COARSE in self._drawn else {}
        for overlay, at_first in {**OVERLAYS, **extra}.items():
            visible = at_first and overlay not in self._cell.hidden
            visible |= overlay == "collision" and not self._cell.visuals[name]
            self._overlays[name][overlay] = api.add_frame(
                f"/{name}/{overlay}", show_axes=False, visible=visible
            )
        if "meshes" in self._drawn:
            self._draw_meshes(name, "meshes", _add_parts)
        if COARSE in self._drawn:
            self._draw_meshes(name, COARSE, _add_plain)
        if "frames" in self._drawn:
            self._draw_frames(name)
        if "collision" in self._drawn or not self._cell.visuals[name]:
            self._draw_hulls(name, colour)
        reach = placement.robot.reach
        if "reach" in self._drawn:
            self._draw_circle(name, reach, colour)
        if "reach sphere" in self._drawn:
            api.add_icosphere(
                f"/{name}/reach sphere/ball", reach, color=colour, opacity=0.12, side="double",
                subdivisions=4, cast_shadow=False, receive_shadow=False,
            )  # fmt: skip
        api.add_label(f"/{name}/label", name, position=(0.0, 0.0, min(0.15, reach / 4)))

    def _draw_meshes(self, name: str, overlay: str, add: Callable[..., Any]) -> None:
        kinematics = self._cell.models[name].kinematics
        for link, parts in self._cell.visuals[name].items():
            handle = add(self._api, node(name, overlay, link), parts)
            self._moving[name].append((kinematics.link(link), handle))

    def _draw_frames(self, name: str) -> None:
        kinematics = self._cell.models[name].kinematics
        robot = self._cell.layout[name].robot
        bodies = sorted({*kinematics.bodies, link_index(kinematics, robot.tcp_link)})
        for link in bodies:
            length = robot.reach * (BASE_FRAME_LENGTH if link == 0 else FRAME_LENGTH)
            handle = self._api.add_frame(
                node(name, "frames", kinematics.links[link]),
                axes_length=length,
                axes_radius=length / 25,
            )
            self._moving[name].append((link, handle))

        if any(robot.tcp_offset):
            self._api.add_frame(
                node(name, "frames", robot.tcp_link) + "/tcp",
                axes_length=robot.reach * FRAME_LENGTH,
                axes_radius=robot.reach * FRAME_LENGTH / 25,
                position=robot.tcp_offset,
            )

    def _draw_hulls(self, name: str, colour: tuple[int, int, int]) -> None:
        model = self._cell.models[name]
        touching = self._api.add_frame(f"/{name}/touching", show_axes=False)
        touching.visible = True
        for link in sorted({hull.link for hull in model.hulls}):
            name_of_link = model.kinematics.links[link]
            vertices, faces = _joined([h.corners for h in model.hulls if h.link == link])
            for overlay, rgb in (("collision", colour), ("touching", TOUCHING)):
                handle = self._api.add_mesh_simple(
                    node(name, overlay, name_of_link), vertices, faces, color=rgb,
                    opacity=0.45, flat_shading=True, side="double", cast_shadow=False,
                    receive_shadow=False, visible=overlay == "collision",
                )  # fmt: skip
                self._moving[name].append((link, handle))
                if overlay == "touching":
                    self._touching[name, name_of_link] = handle

    def _draw_circle(self, name: str, reach: float, colour: tuple[int, int, int]) -> None:
        """Draw the reach around the base, in the world's horizontal plane."""
        w, x, y, z = self._cell.layout[name].base_quaternion
        level = self._api.add_frame(f"/{name}/reach/level", show_axes=False, wxyz=(w, -x, -y, -z))
        level.visible = True
        angles = np.linspace(0, 2 * math.pi, CIRCLE_POINTS)
        ring = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], 1) * reach
        ring[:, 2] = LIFT
        self._draw_line(f"/{name}/reach/level/circle", ring, colour)

    def _draw_ways(self, name: str, colour: tuple[int, int, int]) -> None:
        for number, line in enumerate(self._cell.ways.get(name, ())):
            self._draw_line(node("(ways)", name, str(number)), line, colour)

    def _draw_line(self, path: str, points: Floats, colour: tuple[int, int, int]) -> None:
        """Draw a line through points, (n, 3) (m)."""
        self._api.add_line_segments(
            path,
            points=np.stack([points[:-1], points[1:]], 1),
            colors=colour,
            thickness=3.0,
            thickness_units="screen",
        )

    def _draw_floor(self) -> None:
        """Draw a grid below the lowest base, and the tables of the layout's frames."""
        places = np.array([p.base_position for p in self._cell.layout.values()])
        low = min(0.0, float(places[:, 2].min()))
        if not self._cell.things:
            size = 2 * float(np.ceil(np.abs(places[:, :2]).max() + 2))
            self._api.add_grid(
                node("(floor)"), size, size, plane="xy", cell_size=0.1, section_size=1.0,
                position=(0.0, 0.0, low - LIFT), cell_color=(232, 232, 232),
                section_color=(200, 200, 200),
            )  # fmt: skip
        for name, corners in table_outlines(self._cell.layout.frame_poses).items():
            self._api.add_mesh_simple(
                node("(tables)", name),
                np.array(corners),
                np.array([[0, 1, 2], [0, 2, 3]]),
                color=TABLE_COLOUR,
                side="double",
                cast_shadow=False,
            )


def _add_parts(api: Any, path: str, parts: Sequence[Visual]) -> Any:
    import trimesh

    scene = trimesh.Scene([simplified(part).mesh for part in parts])
    data: Any = scene.export(file_type="glb")
    return api.add_glb(path, data)


def _add_plain(api: Any, path: str, parts: Sequence[Visual]) -> Any:
    """Add parts coarsely, each in one colour that needs little computing."""
    frame = api.add_frame(path, show_axes=False)
    for number, part in enumerate(map(coarse, parts)):
        *rgb, alpha = part.rgba
        api.add_mesh_simple(
            f"{path}/{number}",
            np.asarray(part.mesh.vertices, np.float32),
            np.asarray(part.mesh.faces, np.uint32),
            color=tuple(round(255 * share) for share in rgb),
            opacity=alpha if alpha < 1 else None,
            material="toon5",
            flat_shading=True,
            cast_shadow=False,
        )
    return frame


def _joined(hulls: Sequence[Floats]) -> tuple[Any, Any]:
    import trimesh

    mesh: Any = trimesh.util.concatenate([trimesh.convex.convex_hull(c) for c in hulls])
    return np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32)


def _wxyz(rotation: Floats) -> tuple[float, ...]:
    w, x, y, z = quaternion_of(rotation).tolist()
    return (w, x, y, z)


def _rgb(colour: str) -> tuple[int, int, int]:
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return (red, green, blue)
