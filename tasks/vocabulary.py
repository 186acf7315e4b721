"""Every name that a task's file may need; `from tasks import` takes them from here.

Functions of arrays are in `tasks.maths`, presets of layouts in `layouts`.
"""

from robot_layouts.simulation import (
    Box,
    Camera,
    Capsule,
    Cylinder,
    Friction,
    Mesh,
    PhysicsSettings,
    Plane,
    Shape,
    Sphere,
    State,
    World,
    add_table,
)
from robot_layouts.simulation.scene.shapes import POLISHED, Color, Finish, linear
from robot_layouts.simulation.state import once_per_state
from robots.descriptor import Quaternion, Vector3
from tasks.engine.env import MultiRobotTask, TaskEnv
from tasks.engine.scenario import Scenario
from tasks.engine.task import Info
from tasks.language.bodies import (
    Area,
    Ball,
    Compound,
    Cube,
    Cuboid,
    Goal,
    Peg,
    Table,
    Target,
    WideTable,
)
from tasks.language.needs import Needs
from tasks.language.poses import angle_between, compose, inverse, transform
from tasks.language.props import (
    BLUE,
    DARK_BLUE,
    DARK_RED,
    FACE_UP,
    GREEN,
    RED,
    TARGET_HEIGHT,
    WHITE,
    add_goal,
    add_target,
    add_wide_table,
)
from tasks.language.randomness import EpisodeRandom
from tasks.language.shaping import closeness, letting_go, stillness
from tasks.language.stacking import diagonal, distance_to_top, is_at_rest, lies_on
from tasks.randomization.declaration import Randomization, Shift
from tasks.randomization.distractors import Distractors
from tasks.randomization.distributions import Choice, Fixed, LogUniform, Normal, Uniform, Whole
from tasks.randomization.looks import CameraShift, Light, Surface, Texture
from tasks.registry import register_task

__all__ = [
    "Area",
    "BLUE",
    "Ball",
    "Box",
    "Camera",
    "CameraShift",
    "Capsule",
    "Choice",
    "Color",
    "Compound",
    "Cube",
    "Cuboid",
    "Cylinder",
    "DARK_BLUE",
    "DARK_RED",
    "Distractors",
    "EpisodeRandom",
    "FACE_UP",
    "Finish",
    "Fixed",
    "Friction",
    "GREEN",
    "Goal",
    "Info",
    "Light",
    "LogUniform",
    "Mesh",
    "MultiRobotTask",
    "TaskEnv",
    "Needs",
    "Normal",
    "POLISHED",
    "Peg",
    "PhysicsSettings",
    "Plane",
    "Quaternion",
    "RED",
    "Randomization",
    "Scenario",
    "Shape",
    "Shift",
    "Sphere",
    "State",
    "Surface",
    "TARGET_HEIGHT",
    "Table",
    "Target",
    "Texture",
    "Vector3",
    "Uniform",
    "WHITE",
    "Whole",
    "WideTable",
    "World",
    "add_goal",
    "add_table",
    "add_target",
    "add_wide_table",
    "angle_between",
    "closeness",
    "compose",
    "diagonal",
    "distance_to_top",
    "inverse",
    "is_at_rest",
    "letting_go",
    "lies_on",
    "linear",
    "once_per_state",
    "register_task",
    "stillness",
    "transform",
]
