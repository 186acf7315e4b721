"""Every name that a task's file may need; `from tasks import` takes them from here.

Functions of arrays are in `tasks.maths`, presets of layouts in `layouts`.
"""
# ruff: noqa: F401
# pyright: reportUnusedImport=false

from objects.joints import Joint
from objects.shapes import POLISHED, Color, Finish, linear
from robot_layouts.simulation import (
    Box,
    Camera,
    Capsule,
    ConvexHull,
    Cylinder,
    Friction,
    Mesh,
    PhysicsSettings,
    Plane,
    Shape,
    Sphere,
    State,
    World,
    add_ground,
    add_table,
)
from robot_layouts.simulation.state import once_per_state
from robots.descriptor import Quaternion, Vector3
from tasks.engine.cell import CellTask
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
    Ground,
    KitchenCounter,
    Object,
    Peg,
    Surroundings,
    Table,
    Target,
    WideTable,
)
from tasks.language.fitting import Fit
from tasks.language.needs import Needs
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
    add_object,
    add_target,
    add_wide_table,
)
from tasks.language.randomness import EpisodeRandom
from tasks.language.terms import (
    angle_between,
    closeness,
    compose,
    diagonal,
    distance_to_top,
    inverse,
    is_at_rest,
    letting_go,
    lies_on,
    stillness,
    transform,
)
from tasks.randomization.declaration import Randomization, Shift
from tasks.randomization.distractors import Distractors
from tasks.randomization.distributions import Choice, Fixed, LogUniform, Normal, Uniform, Whole
from tasks.randomization.looks import CameraShift, Light, Surface, Texture
from tasks.registry import register_task
