"""TwoArmTray: two arms lift a tray by its ends, and keep it level; their expert; a third arm."""

from functools import partial
from math import pi

import numpy as np

from layouts import Layout, Placement, face_to_face
from robot_layouts.experts import register_expert
from robot_layouts.experts.geometry import gripper_facing, turn, yaw_of
from robot_layouts.experts.grasps import bringing, pick
from robot_layouts.experts.reaching import reaching
from robot_layouts.experts.rehearsal import first_success
from robot_layouts.experts.script import CLOSED, Waypoint
from robot_layouts.kinematics.rotations import rotate
from tasks import Area, Cuboid, Goal, MultiRobotTask, Needs, closeness, register_task
from tasks.maths import maximum, norm, where

GRIP, HEIGHT = 0.25, 0.2  # of a hand from the tray's middle; how high it is to be (m)
SIDES = {"left": -1, "right": 1}


def around_a_tray(robots, *, spacing=1.5):
    """Two arms face each other; more stand behind them, in a row along x."""
    names = list(robots)
    layout = face_to_face({name: robots[name] for name in names[:2]}, spacing=spacing)
    more = {
        name: Placement(robots[name], position=(-0.9 * number, 0.0, 0.0))
        for number, name in enumerate(names[2:], start=1)
    }
    return Layout({**layout, **more})


@register_task("TwoArmTray-v1")
class TwoArmTray(MultiRobotTask):
    """Lift a tray with a gripper at each end, level. Success: 20 cm high, level, held by both."""

    layout = around_a_tray({"left": "panda", "right": "panda"})
    needs = {place: Needs(fingers=True, opening=0.06) for place in SIDES}
    max_episode_steps = 100
    max_reward = 4

    tray = Cuboid((0.03, 0.3, 0.02), spawn=Area(x=(-0.05, 0.05), y=(-0.03, 0.03)))  # m

    def evaluate(self, state):
        """Success: high and level, held by both."""
        held = state.is_grasping("left", "tray") & state.is_grasping("right", "tray")
        high = state.position("tray")[:, 2] >= HEIGHT
        level = state.rotation("tray")[:, 2, 2] >= 0.99
        return {"held": held, "success": held & high & level}

    def observe(self, state, info):
        """The tray, and how far each hand is from its end; joints are observed anyway."""
        left, right = self.ways(state)
        return {"tray_pose": state.pose("tray"), "left_way": left, "right_way": right}

    def dense_reward(self, state, action, info):
        """Reach the ends (1), lift (3); 4 on success."""
        low = maximum(HEIGHT - state.position("tray")[:, 2], 0.0)
        left, right, lift = closeness(*map(norm, self.ways(state)), low)
        reward = where(info["held"], 2.0 + lift, (left + right) * 0.5)
        return where(info["success"], 4.0, reward)

    def ways(self, state):
        """From each hand to where it is to hold the tray, (N, 3) each (m)."""
        middle, along = state.position("tray"), state.rotation("tray")[:, :, 1] * GRIP
        left, right = state.tcp_position("left"), state.tcp_position("right")
        return middle - along - left, middle + along - right


@register_task("ThreeArmTray-v1")
class ThreeArmTray(TwoArmTray):
    """The same, under a lamp. Success: also, the third arm's tip is within 4 cm of the lamp."""

    layout = around_a_tray({"left": "panda", "right": "panda", "third": "panda_stick"})
    lamp = Goal(0.04, spawn=Area(x=-0.3, y=(-0.1, 0.1), z=0.5))

    def evaluate(self, state):
        """Success: that of two arms, and the lamp."""
        info = super().evaluate(state)
        lit = state.tcp_distance("third", "lamp") <= 0.04
        return {**info, "lit": lit, "success": info["success"] & lit}


def lift(task, seed):
    """The expert of both: actions (T, A) that solve the episode of a seed."""

    def script(legs, scene):
        (x, y, z), quaternion = scene.body("tray")
        level = turn("z", yaw_of(quaternion))
        heights = np.linspace(z, HEIGHT + 0.03, legs + 1)[1:]
        parts = {robot: hand(robot, legs, heights, (x, y), level) for robot in SIDES}
        if "third" in task.layout:
            parts["third"] = [reaching(task, "third", "light", lambda s: s.body("lamp")[0])]
        return parts

    return first_success(task, seed, lambda scene: [script(legs, scene) for legs in (4, 8)])


def hand(robot, legs, heights, place, level):
    """One arm's waypoints: take its end, then raise it in step with the other."""
    other = "left" if robot == "right" else "right"
    before = [f"{other}.grasp tray", *(f"{other}.raise {i}" for i in range(legs))]

    def raised(scene, height):
        return [bringing(scene, robot, "tray", (np.array([*place, height]), level))]

    def grips(scene):
        position, quaternion = scene.body("tray")
        end = position + rotate(quaternion, np.array([0.0, SIDES[robot] * GRIP, 0.0]))
        along = yaw_of(quaternion) + pi / 2
        return [(end, gripper_facing(along + turned, 0.0)) for turned in (0.0, pi)]

    rise = [
        Waypoint(f"raise {i}", partial(raised, height=h), CLOSED, after=(before[i],), near=0.04)
        for i, h in enumerate(heights)
    ]
    return [*pick(robot, "tray", grips), *rise]


register_expert("TwoArmTray-v1", lift)
register_expert("ThreeArmTray-v1", lift)
