"""What authors of tasks get wrong in what they build, place and remember."""

import math

import numpy as np

from layouts import single
from robot_layouts.simulation import Box
from tasks import Cube
from tests.tasks.mistakes import Mistake, building, in_turn, remembering, responding, sampling

BOX = Box(half_size=(0.1, 0.1, 0.1))

MISTAKES = (
    Mistake(
        "something remembered of one environment",
        remembering(lambda state: {"start": state.position("cube")[0]}),
        (
            "Tray.remember() returned 'start' as float32 of shape (3,); it must have shape (2, "
            "…): the first axis counts the environments, of which there are 2"
        ),
    ),
    Mistake(
        "an answer that is returned",
        responding(lambda self, state: {"cube": 1}),
        (
            "Tray.respond() returned {'cube': 1}, which has no effect; it moves bodies, "
            "self.simulation.place(…), and returns nothing"
        ),
        steps=1,
    ),
    Mistake(
        "a body placed in too few environments",
        responding(
            lambda self, state: self.simulation.place(
                "cube", state.position("cube")[:1], where=state.full(True)
            )
        ),
        (
            "place takes positions of shape (2, 3) and where of shape (2,), a row for each "
            "environment; given: (1, 3) and (2,)"
        ),
        steps=1,
    ),
    Mistake(
        "a body placed nowhere",
        responding(
            lambda self, state: self.simulation.place(
                "cube", state.position("cube") * math.nan, where=state.full(True)
            )
        ),
        (
            "position of body 'cube' in environment 0 is [nan, nan, nan]; it must be 3 finite "
            "numbers (m)"
        ),
        steps=1,
    ),
    Mistake(
        "a pose that is returned",
        sampling(lambda world, rng: {"cube": (0, 0, 0)}),
        (
            "Tray.sample() returned {'cube': (0, 0, 0)}, which has no effect; it places bodies, "
            "world.set_pose(…), and returns nothing"
        ),
    ),
    Mistake(
        "a quaternion of zeros",
        sampling(lambda world, rng: world.set_pose("cube", (0, 0, 0.02), (0, 0, 0, 0))),
        (
            "quaternion of body 'cube' in environment 0 is [0.0, 0.0, 0.0, 0.0], which has "
            "length 0; a rotation has length 1 (order w, x, y, z)"
        ),
    ),
    Mistake(
        "angles in the place of a quaternion",
        sampling(lambda world, rng: world.set_pose("cube", (0, 0, 0.02), (0, 0, 1.57))),
        (
            "quaternion of body 'cube' in environment 0 is (0, 0, 1.57); it must be 4 finite "
            "numbers (w, x, y, z)"
        ),
    ),
    Mistake(
        "positions of several environments",
        sampling(lambda world, rng: world.set_pose("cube", np.zeros((3, 3)))),
        (
            "position of body 'cube' in environment 0 is array([[0., 0., 0.],\n       [0., 0., "
            "0.],\n       [0., 0., 0.]]); it must be 3 finite numbers (m)"
        ),
    ),
    Mistake(
        "one name where several go",
        sampling(lambda world, rng: world.set_poses("cube", (0, 0, 0.02))),
        "set_poses takes several names; set_pose takes one, 'cube'",
    ),
    Mistake(
        "too few joints",
        sampling(lambda world, rng: world.stand("arm", np.zeros(8))),
        (
            "qpos of robot 'arm' in environment 0 is array([0., 0., 0., 0., 0., 0., 0., 0.]); it "
            "must be 9 finite numbers (rad, m)"
        ),
    ),
    Mistake(
        "a robot that is not there",
        sampling(lambda world, rng: world.stand("left", np.zeros(9))),
        "unknown robot of this layout 'left'. Choices: arm.",
    ),
    Mistake(
        "bounds where a shape goes",
        sampling(lambda world, rng: world.set_pose("cube", (rng.uniform(-0.1, 0.1), 0, 0.02))),
        (
            "rng.uniform takes the shape of what is drawn, whole numbers; given: (-0.1, 0.1). "
            "uniform_between([low, …], [high, …]) draws between bounds"
        ),
    ),
    Mistake(
        "numbers where bounds go",
        sampling(
            lambda world, rng: world.set_pose("cube", (rng.uniform_between(-0.1, 0.1), 0, 0.02))
        ),
        (
            "rng.uniform_between takes the lower bounds and the upper ones, as many: ([low, …], "
            "[high, …]); given: -0.1, 0.1"
        ),
    ),
    Mistake(
        "a body that is returned",
        building(lambda world: world.add("cube")),
        (
            "Tray.build() returned WorldBody(name='cube', shapes=(), kind....0, 0.0), "
            "anchored=False, marker=False), which has no effect; it adds bodies to a world, "
            "world.add(…), and returns nothing"
        ),
    ),
    Mistake(
        "a body without a name",
        building(lambda world: world.add(BOX)),
        (
            "a body's name is Box(position=(0.0, 0.0, 0.0), quaterni...isible=True, "
            "half_size=(0.1, 0.1, 0.1)); it must be a text"
        ),
    ),
    Mistake(
        "a body where shapes go",
        building(lambda world: world.add("cube", Cube(0.02)) and None),
        (
            "body 'cube': Cube(spawn=None, start=None, kind='dyn..._size=0.02, color=(1.0, 0.0, "
            "0.0, 1.0)) is no shape; shapes are Box, Sphere, Cylinder, Capsule, ConvexHull, Mesh"
            " and Plane"
        ),
    ),
    Mistake(
        "a name for two bodies",
        building(lambda world: [world.add("cube", BOX) for _ in "ab"] and None),
        "this world already has a body called 'cube'",
    ),
    Mistake(
        "an unknown kind of body",
        building(lambda world: world.add("cube", BOX, kind="fixed") and None),
        ("body 'cube': kind 'fixed' is not offered; choices: 'dynamic', 'kinematic', 'static'"),
    ),
    Mistake(
        "a body that is not built",
        building(lambda world: None),
        "unknown body of this world 'cube'. Choices: none.",
    ),
    Mistake(
        "other bodies in the second environment",
        building(
            in_turn(
                lambda world: world.add("cube", BOX) and None,
                lambda world: world.add("cuboid", BOX) and None,
                calls=1,
            )
        ),
        (
            "environment 1 has the bodies ['cuboid'], environment 0 ['cube']; all have the same "
            "ones, added in the same order"
        ),
    ),
    Mistake(
        "something returned from begin_episodes",
        dict(begin_episodes=lambda self, state, ids: 5),
        (
            "Tray.begin_episodes() returned 5, which has no effect; it sets what the task "
            "remembers, self.memory.…, and returns nothing"
        ),
    ),
    Mistake(
        "an unknown obs_mode",
        {},
        (
            "unknown obs_mode 'states'. Did you mean 'state'? Choices: state, state_dict, none,"
            " lerobot, lerobot+video, robomimic, lerobot+cameras, lerobot+cameras+depth,"
            " robomimic+cameras, robomimic+cameras+depth, rgbd, pointcloud, sensor_data, rgb,"
            " rgb+depth+state, depth, rgb+segmentation. Besides, any of rgb, depth, segmentation,"
            " position, normal, albedo are joined by '+', and state or state_dict to them"
        ),
        fields={"obs_mode": "states"},
    ),
    Mistake(
        "dense rewards of a task without them",
        dict(dense_reward=None),
        "reward_mode 'dense' is not offered; choices: None, 'sparse', 'none'",
        fields={"reward_mode": "dense"},
    ),
    Mistake(
        "something that is not remembered",
        dict(dense_reward=lambda self, state, action, info: self.memory.start),
        "unknown array that remember() returned 'start'. Choices: none.",
        steps=1,
    ),
    Mistake(
        "fingers of a stick",
        dict(
            evaluate=lambda self, state: {"success": state.finger_gap("arm") > 0},
            layout=single({"arm": "panda_stick"}),
        ),
        "robot 'arm' has no fingers",
    ),
)
