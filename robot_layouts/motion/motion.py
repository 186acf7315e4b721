"""Motions of robots, and what can be done with one: certify it, join, draw, save and export it."""

from __future__ import annotations

from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np

from robot_layouts.core.bounds import FAR, checked_number
from robot_layouts.core.errors import MotionError
from robot_layouts.motion.certificate import Certificate, certify
from robot_layouts.motion.timed_motion import TimedMotion

SAME = 1e-6  # rad, m: so far apart is the same place


class Motion(TimedMotion):
    """Joint positions of all robots of a layout over time, as `robot_layouts.motion.plan` finds it.

    Between the knots the positions follow cubic curves (Hermite's), which have the positions and
    velocities of the knots; before the first knot and after the last everything stands still. All
    arrays are read-only.

    Attributes:
        layout: The robots, and where they stand.
        times: Of the knots, from 0, increasing, (T,) with T of 2 or more (s).
        positions: Joint positions there by robot, in its descriptor's order, (T, dof) (rad, m).
        velocities: Joint velocities there by robot, (T, dof) (rad/s, m/s).
        obstacles: What the robots were kept clear of, besides each other.
        held: Bodies that they carry.
        table: Outline of a table whose top is at z = 0, as x_min, y_min, x_max, y_max (m).
        clearance: How far the robots were asked to stay from everything (m).
        largest_velocities: What the joints may do by robot, (dof,) (rad/s, m/s); robots that are
            left out may do what their URDFs allow.
        largest_accelerations: The same for accelerations, (dof,) (rad/s², m/s²); those of robots
            that are left out are not limited.

    Raises:
        MotionError: If the arrays do not fit the layout or each other, or hold what is no number,
            or one beyond a million.
    """

    def certify(self, *, step: float = 1e-3, turn: float = np.radians(0.5)) -> Certificate:
        """Check the whole motion again, densely and exactly.

        Joint limits and limits of velocity and acceleration are checked first. If a joint is beyond
        its limits or too fast, the certificate says so and ends there. Then come collisions of all
        robots with each other, with themselves, with tables and with obstacles, also those that
        move. Between two moments that are checked no point of any body moves farther than
        ``step``, no body turns farther than ``turn``, and no two come nearer to each other than
        they are apart, or by more than 0.01 mm. Measured is the least clearance, with who and when.

        Args:
            step: From 1e-6 (m).
            turn: From 1e-6 (rad).

        Returns:
            The certificate: ``ok``, what was found, and a readable ``str``.

        Raises:
            AssetError: If a robot's files cannot be found or are invalid.
            MissingPackageError: If python-fcl is not installed.
            MotionError: If ``step`` or ``turn`` is invalid, or takes too many moments.
        """
        return certify(self, step, turn)

    def then(self, other: Motion, rest: float = 0.0) -> Motion:
        """Return this motion and another one after it, with what was said of this one.

        Args:
            other: Of the same layout; begins where this one ends, both at rest.
            rest: How long everything stands still in between (s).

        Raises:
            MotionError: If it does not, or the rest is negative.
        """
        if other.layout != self.layout:
            raise MotionError(f"{other!r} is of another layout than {self!r}")
        rest = checked_number("rest", rest, 0.0, FAR, MotionError, "s")
        for name, end in self.end.items():
            if self.velocities[name][-1].any() or other.velocities[name][0].any():
                raise MotionError(f"{name} does not stand still between the two motions")
            away = float(np.abs(other.start[name] - end).max(initial=0.0))
            if away > SAME:
                raise MotionError(
                    f"{name} begins {away:.3g} from where it ended; plan the second motion from"
                    " the end of the first"
                )
        first = 1 if rest == 0.0 else 0  # the knot that both have
        later = self.duration + rest + other.times[first:]
        return replace(
            self,
            times=np.concatenate([self.times, later]),
            positions={
                name: np.concatenate([qpos, other.positions[name][first:]])
                for name, qpos in self.positions.items()
            },
            velocities={
                name: np.concatenate([speeds, other.velocities[name][first:]])
                for name, speeds in self.velocities.items()
            },
        )

    def picture(self, path: str | PathLike[str]) -> Path:
        """Save a picture of the motion from above, with distances and speeds over time below.

        Robots stand where they start, pale, and where they end; the way of each TCP is a line in
        the robot's colour, with dots at round times. A moving picture shows them on their way.
        Below are the distance of what is nearest to each other, robots or obstacles, and the speed
        of each robot's fastest joint. Needs the robots' files and matplotlib.

        Args:
            path: Where to save; the ending chooses the format: .png, .pdf or .svg, and for moving
                pictures .webp or .gif.

        Returns:
            The path of the picture.

        Raises:
            AssetError: If a robot's files cannot be found or are invalid.
            MissingPackageError: If matplotlib is not installed.
            MotionError: If the ending names no supported format.
            UnwritableFileError: If it cannot be written (also an ``OSError``).
        """
        from robot_layouts.motion.output.pictures import save_picture

        return save_picture(self, path)

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the motion to a file, whole or not at all, and return its path.

        The file is JSON, and says all there is to know: the layout, every robot's joints, knots,
        obstacles and what is held. `load` gives the same motion, to the last bit.

        Args:
            path: Where to save; must end in ``.json``.

        Raises:
            LayoutError: If a robot is not registered, or not as it is here.
            MotionError: If the path ends otherwise.
            UnwritableFileError: If it cannot be written (also an ``OSError``).
        """
        from robot_layouts.motion.output.files import save_motion

        return save_motion(self, path)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Motion:
        """Return the motion in a file that `save` wrote.

        Raises:
            MotionError: If the file cannot be read, is damaged, or its robots are not as here; the
                message names the file.
        """
        from robot_layouts.motion.output.files import load_motion

        return load_motion(path, cls)

    def to_csv(self, folder: str | PathLike[str], *, frequency: float | None = None) -> list[Path]:
        """Write a table for each robot, ``NAME.csv``: time, joint positions, joint velocities.

        Args:
            folder: Where; nothing that is there is overwritten.
            frequency: Rows per second, besides one at the end; None takes the knots (Hz).

        Returns:
            The files.

        Raises:
            MotionError: If the frequency is invalid.
            UnwritableFileError: If a file is there already, or cannot be written.
        """
        from robot_layouts.motion.output.files import to_csv

        return to_csv(self, folder, frequency)

    def to_ros2(self, folder: str | PathLike[str], *, frequency: float | None = None) -> list[Path]:
        """Write a trajectory for each controller of the ROS 2 package of `Layout.to_ros2`.

        ``left_arm_controller.yaml`` is a ``trajectory_msgs/msg/JointTrajectory``, with the joints'
        names of that package.

        Args:
            folder: Where; nothing that is there is overwritten.
            frequency: Points per second, besides one at the end; None takes the knots (Hz).

        Returns:
            The files.

        Raises:
            AssetError: If a robot's files cannot be found or are invalid.
            MotionError: If the frequency is invalid.
            UnwritableFileError: If a file is there already, or cannot be written.
        """
        from robot_layouts.motion.output.files import to_ros2

        return to_ros2(self, folder, frequency)
