"""A task, and what may vary in it."""

from dataclasses import replace

from tasks import (
    CameraShift,
    Distractors,
    Light,
    LogUniform,
    Normal,
    Randomization,
    Shift,
    Surface,
    Texture,
    Uniform,
    Whole,
)

TASK = "TwoRobotPickCube-v1"
IN_PLACE = Randomization(
    mass={"cube": LogUniform(0.5, 2.0), "left": Uniform(0.8, 1.2)},
    friction={"cube": Uniform(0.2, 1.0), "*.panda_hand": Uniform(0.5, 1.5)},
    stiffness={"left": LogUniform(0.8, 1.25)},
    damping={"*.arm": LogUniform(0.8, 1.25)},
    joint_friction={"right.panda_joint1": Uniform(0.0, 0.2)},
    bases={"*": Shift(x=Uniform(-0.02, 0.02), yaw=Normal(0.05, low=-0.1, high=0.1))},
    action_noise={"left.arm": Normal(0.02)},
    action_delay=Whole(0, 2),
    sensor_noise={"*.qpos": Normal(0.01), "*_pose": Normal(0.001)},
    observation_delay=Whole(0, 2),
)
VARIED = replace(IN_PLACE, size={"cube": Uniform(0.8, 1.2)}, gravity=Uniform(9.0, 10.5))
"""All that is physical; the expert solves some of these worlds."""

EVERY_AXIS = replace(
    VARIED,
    cameras={"*": CameraShift(x=Uniform(-0.05, 0.05), fov=Uniform(0.8, 1.2))},
    lights={"*": Light(turn=Uniform(-1, 1), strength=Uniform(0.5, 1.5))},
    colors={"left": Surface(green=Uniform(0, 1), share=0.5)},
    textures={"table-workspace": Texture()},
    distractors=Distractors(count=Whole(0, 4)),
    spread=Uniform(0.2, 1.0),
)
