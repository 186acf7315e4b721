"""CellSwapPlaces: one arm parks the red cube, the next brings the blue one, the last the red."""

from __future__ import annotations

import numpy as np

from robot_layouts.experts.cells.moves import carry, cube_holds, stand_back
from robot_layouts.experts.geometry import planar_distance
from robot_layouts.experts.grasps import YAWS, need_fingers
from robot_layouts.experts.rehearsal import Plan, first_success
from robot_layouts.experts.script import Scene, Script
from tasks import TaskEnv
from tasks.cells.swap_places import HALF


def swap_places(task: TaskEnv, seed: int) -> Plan:
    """Return the actions of all arms, (T, A), that swap the cubes.

    Raises:
        TaskError: If an arm has no fingers, or cannot reach what it should.
    """
    need_fingers(task, "swapping cubes", *task.layout.arms)
    return first_success(
        task,
        seed,
        lambda scene: [_script(task, scene, height) for height in (0.1, 0.08, 0.14)],
        as_declared=True,
    )


def _script(task: TaskEnv, scene: Scene, height: float) -> Script:
    arms, red, blue = [*task.layout.arms], scene.body("red")[0], scene.body("blue")[0]
    places = [scene.body(f"place_{arm}")[0] for arm in arms]
    free = int(np.argmax([planar_distance(p, red) + planar_distance(p, blue) for p in places]))
    parked = np.array([*places[free][:2], HALF])
    first, second, third = (arms[(free + step) % len(arms)] for step in (1, 2, 3))
    waits = [f"{arm}.wait" for arm in (second, third)]
    moves = {
        first: ("red", parked, waits, []),
        second: ("blue", red, [], [f"{first}.retreat red"]),
        third: ("red", blue, [f"{first}.retreat red"], [f"{second}.retreat blue"]),
    }
    return {
        arm: (
            stand_back(task, arm),
            *carry(
                task,
                arm,
                cube,
                cube_holds(cube),
                lambda scene, to=to: to,
                height=height,
                yaws=YAWS,
                taking=taking,
                turn_of=turn_of,
            ),
        )
        for arm, (cube, to, taking, turn_of) in moves.items()
    }
