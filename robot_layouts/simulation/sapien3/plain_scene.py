"""A layout as a plain SAPIEN scene, for loops of one's own."""

from __future__ import annotations

import sapien

from layouts import Layout
from robot_layouts.simulation.physics import PhysicsSettings
from robot_layouts.simulation.sapien3.world import BuiltWorld


def build_scene(
    layout: Layout, physics: PhysicsSettings | None = None, *, visuals: bool = False
) -> sapien.Scene:
    """Build a SAPIEN scene with a layout's robots and nothing else.

    Each robot is an articulation that is called as in the layout, stands at its keyframe and holds
    it by its drives. ``scene.step()`` advances by the settings' timestep.

    Args:
        layout: Which robots stand where.
        physics: Solver settings; None keeps SAPIEN's own defaults.
        visuals: Whether to build what pictures need (a Vulkan driver must be present).

    Raises:
        AssetError: If a robot's files cannot be found.
        SimulationError: If pictures are wanted and there is no Vulkan driver.
    """
    world = BuiltWorld(layout, physics, visuals=visuals)
    world.settle()
    for name, robot in world.robots.items():
        robot.articulation.name = name
        start = layout[name].start_qpos
        robot.reset(start)
        for joint, position in zip(robot.driven, start, strict=True):
            joint.set_drive_target(position)
    return world.scene
