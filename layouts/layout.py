"""A layout: which robots stand where, and what one asks of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from layouts.arrangement import Arrangement
from robot_layouts.core.figures import save_figure
from robot_layouts.core.writing import write_whole
from robots import LayoutError
from robots.named import written_robot

if TYPE_CHECKING:
    from layouts.validation import Report


class Layout(Arrangement):
    """Ordered, named placements: a read-only mapping from name to `Placement`.

    The order is the order of the robots' action numbers. Two layouts are equal if they place the
    same robots under the same names in the same order.
    """

    def __str__(self) -> str:
        """Show a table: name, robot, action numbers, base pose, keyframe and reach of each."""
        from layouts.preview import describe

        return describe(self)

    def _repr_html_(self) -> str:
        """Show a notebook the picture from above."""
        from layouts.preview import layout_html

        return layout_html(self)

    def to_yaml(self, folder: str | PathLike[str] = "") -> str:
        """Return the layout as YAML text, as it was declared.

        Robots stand there by their registered names; those of ``MODULE:NAME`` by that, and those
        that were guessed from a URDF or MJCF by its path. `from_yaml` turns the text into an equal
        layout.

        Args:
            folder: What paths are relative to; the present folder unless it is given.

        Raises:
            LayoutError: If a robot goes by none of these, or not as it is here.
        """
        from layouts.yaml_format import to_yaml

        return to_yaml(self, lambda robot: written_robot(robot, Path(folder)))

    @classmethod
    def from_yaml(cls, text: str, folder: str | PathLike[str] = "") -> Layout:
        """Return the layout that a YAML text describes.

        No code runs that the text chooses: a robot ``MODULE:NAME`` is taken if the module is
        imported already, and a xacro template if it was expanded before.

        Args:
            text: The text.
            folder: What paths of robots are relative to; the present folder unless it is given.

        Raises:
            LayoutError: If it describes none; the message names the line.
        """
        from layouts.yaml_format import from_yaml

        return cls._of(from_yaml(text, folder=folder))

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the layout to a YAML file, whole or not at all, and return its path.

        Paths of robots are relative to the file's folder; see `to_yaml`.

        Raises:
            LayoutError: If a robot goes by nothing that a file can hold, or not as it is here.
            UnwritableFileError: If it cannot be written (also an ``OSError``).
        """
        text = self.to_yaml(Path(path).parent)
        write_whole(path, text)
        return Path(path)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Layout:
        """Return the layout in a YAML file; see `from_yaml`.

        Raises:
            LayoutError: If the file cannot be read or describes no layout; the message names the
                file and the line.
        """
        from layouts.yaml_format import read_layout

        return cls._of(read_layout(path))

    @classmethod
    def _of(cls, arrangement: Arrangement) -> Layout:
        return cls(arrangement, arrangement.frames)

    def to_urdf(
        self, path: str | PathLike[str], *, relative: bool = False, visuals: bool = True
    ) -> Path:
        """Save the layout as one URDF, in which every robot is fixed to a link ``world``.

        Names of links, joints and materials stand behind their place: ``left/panda_hand``.
        Meshes stay where they are. Pairs of links that the robots' SRDFs leave out of collision
        checks are saved beside it, as ``.srdf``. A URDF has no joint positions to start from;
        transmissions and other programs' extensions are left out.

        Args:
            path: Where to save; must end in ``.urdf``.
            relative: Whether meshes are referred to by paths relative to the file's folder, not
                by absolute ones.
            visuals: Whether to include what the robots look like; without, only the files that
                physics needs are looked for.

        Returns:
            The path of the URDF.

        Raises:
            LayoutError: If the path ends otherwise.
            AssetError: If a robot's files cannot be found or are invalid.
        """
        from layouts.export.urdf import write_urdf

        return write_urdf(self, path, relative=relative, visuals=visuals)

    def to_drake(self, path: str | PathLike[str], *, visuals: bool = True) -> Path:
        """Save the layout as Drake's model directives: a model, its pose and start per robot.

        The models are called as the robots are here. Drake reads no STL, GLB or PLY meshes, so
        each robot is saved with converted ones in a folder ``NAME_robots`` beside the file, which
        is replaced if it exists. The file refers to the folder by its absolute path.

        Args:
            path: Where to save; must end in ``.dmd.yaml``.
            visuals: See `to_mjcf`.

        Returns:
            The path of the directives.

        Raises:
            LayoutError: If the path ends otherwise.
            AssetError: If a robot's files cannot be found or are invalid.
            DescriptorError: If a descriptor contradicts its URDF.
            MissingPackageError: If scipy is not installed.
        """
        from layouts.export.drake import write_drake

        return write_drake(self, path, visuals=visuals)

    def to_mjcf(self, path: str | PathLike[str], *, visuals: bool = True) -> Path:
        """Save the layout as one MJCF model for MuJoCo, with meshes in a folder ``NAME_assets``.

        Names of bodies, joints and actuators stand behind their place: ``left/panda_hand``. Every
        joint of the descriptor, in its order, has a position actuator with its stiffness, damping
        and force limit: force = clamp(stiffness · (ctrl - position) - damping · speed), as in
        SAPIEN. Joints that mimic others are tied to them as well, so their ``ctrl`` must follow,
        too: both fingers of a Panda get the same. Where a link is too light for its drive's damper
        at the model's timestep, its joint has more armature than the descriptor gives it.
        Links have no weight (``gravcomp``), as in the tasks here, so that the keyframe ``home``,
        where the layout starts, holds. Bodies may touch unless `validate` lets their links
        overlap. Meshes collide by their convex hulls. TCPs (``left/tcp``) and frames are sites,
        tables are boxes; there is no floor, as a layout has none. The timestep is the longest of
        2 ms and less at which every drive is stable; ``solref`` of contacts is twice as long.

        Args:
            path: Where to save; must end in ``.xml``. The folder beside it is replaced if it
                exists.
            visuals: Whether to include what the robots look like. A robot whose visual meshes
                cannot be found is drawn by its collision shapes; a line on stderr says so.

        Returns:
            The path of the model.

        Raises:
            LayoutError: If the path ends otherwise, or the folder holds something else.
            AssetError: If a robot's files cannot be found or are invalid.
            DescriptorError: If a descriptor contradicts its URDF.
            MissingPackageError: If scipy is not installed.
        """
        from layouts.export.mjcf import write_mjcf

        return write_mjcf(self, path, visuals=visuals)

    def to_usd(self, path: str | PathLike[str], *, visuals: bool = True) -> Path:
        """Save the layout as one USD stage with UsdPhysics articulations, meshes included.

        Lengths are in m, z is up. Each place is an articulation ``/NAME/left`` whose root is fixed
        to the world, its links ``/NAME/left/panda_hand`` stand where the layout starts the robot,
        and its joints are in ``/NAME/left/joints``, with limits, and drives of the descriptor's
        stiffness, damping and force limit. Letters that USD has not are ``_``; the display name
        keeps them. Links that `validate` lets overlap are filtered pairs. What UsdPhysics lacks is
        given as PhysX's attributes, which others ignore: joints that mimic others, armature,
        largest speeds, joint positions, links without weight. TCPs, frames and cameras are prims;
        tables are boxes; there is no floor.

        Args:
            path: Where to save; must end in ``.usd``, ``.usda`` or ``.usdc``.
            visuals: See `to_mjcf`.

        Returns:
            The path of the stage.

        Raises:
            LayoutError: If the path ends otherwise.
            AssetError: If a robot's files cannot be found or are invalid.
            DescriptorError: If a descriptor contradicts its URDF.
            MissingPackageError: If usd-core or scipy is not installed.
        """
        from layouts.export.cell import ExportedCell
        from layouts.export.files import USD_ENDINGS, expect_ending

        target = expect_ending(path, "a USD stage", *USD_ENDINGS)
        from layouts.export.usd import write_usd  # which needs usd-core

        return write_usd(ExportedCell.read(self, visuals=visuals), target, visuals=visuals)

    def to_ros2(self, folder: str | PathLike[str], *, visuals: bool = True) -> Path:
        """Save the layout as a ROS 2 package for MoveIt and ros2_control, meshes included.

        Names of links and joints stand behind their place: ``left_panda_hand``. The URDF has every
        robot fixed to a link ``world``, and links for frames and TCPs (``left_tcp``). Planning
        groups are ``left`` for each place, ``left_arm`` and ``left_gripper`` for what it moves,
        ``left_LIMB…`` for each limb, and ``all``; each has a state ``home``, where the layout
        starts. Collision shapes are the convex hulls of `validate`, and the disabled pairs those
        that it leaves out. ``launch/demo.launch.py`` starts controllers on mock hardware, and
        MoveIt. The format is that of ROS 2 Jazzy and later.

        Args:
            folder: The package, whose name is that of the folder. It is replaced if it exists and
                holds nothing but what an export leaves.
            visuals: See `to_mjcf`.

        Returns:
            The folder.

        Raises:
            LayoutError: If the folder's name is no valid package name, or it holds something else.
            AssetError: If a robot's files cannot be found or are invalid.
            DescriptorError: If a descriptor contradicts its URDF.
            MissingPackageError: If scipy is not installed.
        """
        from layouts.export.cell import ExportedCell
        from layouts.export.ros2 import write_ros2

        return write_ros2(ExportedCell.read(self, visuals=visuals), folder, visuals=visuals)

    def preview(
        self,
        path: str | PathLike[str],
        *,
        table: tuple[float, float, float, float] | None = None,
    ) -> Path:
        """Save a picture of the layout from above: bases, headings, reach and its overlap.

        Needs matplotlib, but neither robot files nor a graphics driver.

        Args:
            path: Where to save; the ending chooses the format (.png, .pdf or .svg).
            table: Outline of a table, as x_min, y_min, x_max, y_max (m).

        Returns:
            The path of the picture.

        Raises:
            LayoutError: If the ending names no supported format, or the table is no rectangle.
            MissingPackageError: If matplotlib is not installed.
        """
        from layouts.preview import draw

        return save_figure(lambda: draw(self, table), path, "preview", LayoutError)

    def validate(
        self,
        *,
        targets: Mapping[str, Sequence[float]] | Sequence[Sequence[float]] = (),
        samples: int = 20,
        table: tuple[float, float, float, float] | None = None,
        seed: int = 0,
        workspaces: bool = True,
    ) -> Report:
        """Check the layout before anything moves, from the robots' real collision shapes.

        Looks for robots that collide with each other, with themselves or with tables at their
        keyframes and with joint noise, for keyframes beyond the joint limits, and for targets that
        no robot reaches; measures distances and shared workspaces. Needs the robots' files.

        Args:
            targets: What some robot must reach, by name or in order: x, y, z of a tool centre
                point in the world (m), or these and the wxyz quaternion of the TCP link.
            samples: How many postures with joint noise to look at, besides the keyframes.
            table: Outline of a table whose top is at z = 0, as x_min, y_min, x_max, y_max (m),
                besides those that are among the layout's frames. Bases may stand on tables.
            seed: Of the joint noise.
            workspaces: Whether to measure how much space robots share, to about a tenth.

        Returns:
            The report: ``ok``, ``findings``, a readable ``str`` and ``picture(path)``.

        Raises:
            LayoutError: If an argument is invalid.
            AssetError: If no robot's files can be found and read. Where only some cannot, a finding
                says so.
            DescriptorError: If the robots' descriptors contradict their URDFs.
            MissingPackageError: If python-fcl is not installed.
        """
        from layouts.validation.check import LayoutCheck

        return LayoutCheck(self, targets, samples, table, seed).run(workspaces)
