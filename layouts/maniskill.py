"""The layouts of ManiSkill's tasks, by its task ids; data that needs neither tasks nor simulator.

Sources are files of mani_skill 3.0.1, under ``mani_skill/``. Its table scene,
``utils/scene_builder/table/scene_builder.py`` (``TABLE``), stands a single robot at its home, which
the robot's descriptor holds, and two robots at y = -0.75 and y = +0.75 m, face to face.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from math import hypot

from layouts.layout import Layout
from layouts.placement import Placement
from layouts.presets import face_to_face, single
from robots import UnknownNameError
from robots.descriptor import Vector3

TABLE = "utils/scene_builder/table/scene_builder.py"
ROTATE_VALVE = "envs/tasks/dexterity/rotate_valve.py"
ROLL_BALL_LENGTH = hypot(0.7071, 0.7072)  # native's (0.7071, 0, 0, -0.7072), scaled to length 1


def _one(robot: str, **place: object) -> Layout:
    return Layout({"arm": Placement(robot, **place)})  # type: ignore[arg-type]


def _two(robot: str, spacing: float) -> Layout:
    return face_to_face({"left": robot, "right": robot}, spacing=spacing)


def _g1(position: Vector3, **place: object) -> Layout:
    robot = "unitree_g1_simplified_upper_body_with_head_camera"
    return Layout({"robot": Placement(robot, position, qpos_noise=0.0, **place)})  # type: ignore[arg-type]


_panda = partial(single, {"arm": "panda"})
_panda_wristcam = partial(single, {"arm": "panda_wristcam"})
_panda_stick = partial(_one, "panda_stick", qpos_noise=0.0)
_dclaw = partial(
    _one,
    "dclaw",
    position=(0.0, 0.0, 0.28),
    quaternion=(0.0, 0.0, -1.0, 0.0),
    qpos=(0.7, -0.7, -0.7, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)

# id -> (how to build the layout, where native has its numbers), sorted by id.
TASKS: Mapping[str, tuple[Callable[[], Layout], str]] = {
    "DrawTriangle-v1": (
        _panda_stick,
        "envs/tasks/drawing/draw_triangle.py: TableSceneBuilder(robot_init_qpos_noise=0)",
    ),
    "FMBAssembly1Easy-v1": (_panda, TABLE),
    "LiftPegUpright-v1": (_panda, TABLE),
    "PegInsertionSide-v1": (_panda_wristcam, TABLE),
    "PickCube-v1": (_panda, TABLE),
    "PickCubeSO100-v1": (partial(single, {"arm": "so100"}), TABLE),
    "PlaceSphere-v1": (_panda, TABLE),
    "PlugCharger-v1": (
        partial(_panda_wristcam, keyframe="rest"),
        "envs/tasks/tabletop/plug_charger.py: its own joint positions",
    ),
    "PokeCube-v1": (_panda, TABLE),
    "PullCube-v1": (_panda, TABLE),
    "PullCubeTool-v1": (_panda, TABLE),
    "PushCube-v1": (_panda, TABLE),
    "PushT-v1": (
        partial(_one, "panda_stick", keyframe="push_start"),
        "envs/tasks/tabletop/push_t.py: its own joint positions",
    ),
    "RollBall-v1": (
        partial(
            _one,
            "panda",
            position=(-0.1, 1.0, 0.0),
            quaternion=(0.7071 / ROLL_BALL_LENGTH, 0.0, 0.0, -0.7072 / ROLL_BALL_LENGTH),
        ),
        "envs/tasks/tabletop/roll_ball.py",
    ),
    **{f"RotateValveLevel{level}-v1": (_dclaw, ROTATE_VALVE) for level in range(5)},
    "StackCube-v1": (_panda_wristcam, TABLE),
    "StackPyramid-v1": (_panda_wristcam, TABLE),
    "TableTopFreeDraw-v1": (
        _panda_stick,
        "envs/tasks/drawing/draw.py: TableSceneBuilder(robot_init_qpos_noise=0)",
    ),
    "TwoRobotPickCube-v1": (partial(_two, "panda_wristcam", 1.5), TABLE),
    "TwoRobotStackCube-v1": (partial(_two, "panda_wristcam", 1.5), TABLE),
    "UnitreeG1PlaceAppleInBowl-v1": (
        partial(_g1, (-0.3, 0.0, 0.755), keyframe="standing"),
        "envs/tasks/humanoid/humanoid_pick_place.py",
    ),
    "UnitreeG1TransportBox-v1": (
        partial(_g1, (-0.1, 0.0, 0.755), qpos=(0.0, 0.0, 0.0, 1.25, -1.25, *(0.0,) * 20)),
        "envs/tasks/humanoid/transport_box.py",
    ),
}


def from_maniskill(task_id: str) -> Layout:
    """Return the layout of one of ManiSkill's tasks, as the clone of that task has it.

    Args:
        task_id: ManiSkill's id of a task that is cloned here, such as ``TwoRobotPickCube-v1``.

    Raises:
        UnknownNameError: If no layout is known under that id.
    """
    if task_id not in TASKS:
        raise UnknownNameError("ManiSkill task", task_id, TASKS)
    build, _ = TASKS[task_id]
    return build()
