"""PickCubeSO100: PickCube with a small arm, a smaller cube, and a nearer goal."""

from __future__ import annotations

from layouts import single
from tasks import Camera, Cube, Goal, register_task
from tasks.maniskill.pick_cube import PickCube


@register_task("PickCubeSO100-v1", "maniskill.pick_cube_so100_native")
class PickCubeSO100(PickCube):
    """Grasp a small cube from the table and hold it still at a goal in the air.

    Cube and goal are drawn from a square of 0.1 m before the arm, the goal up to 8 cm above the
    cube. Success: the cube is within 1.56 cm of the goal and the arm is static.
    """

    source = "mani_skill 3.0.1, envs/tasks/tabletop/pick_cube.py"
    layout = single({"arm": "so100"})
    viewpoint = ((-0.1, 0.3, 0.4), (-0.46, 0.0, 0.1))
    cameras = (Camera((-0.27, 0.0, 0.4), (-0.56, 0.0, -0.25)),)

    # mani_skill 3.0.1, envs/tasks/tabletop/pick_cube_cfgs.py, "so100" (m)
    cube = Cube(0.0125)
    goal_site = Goal(0.0125 * 1.25)
    spawn_half_size = 0.05
    spawn_centre = (-0.46, 0.0)
    max_goal_height = 0.08
