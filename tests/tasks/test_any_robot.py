"""Any robot stands in any place: every clone takes the others, and its numbers follow them."""

from itertools import cycle, product

import pytest
import torch

import tasks
from layouts import face_to_face
from robots import RobotRegistry, TaskError
from tests.quick import quick_cases

ROBOTS = ("panda", "panda_wristcam", "panda_stick", "so100")


# But for those that need joints of their own robot's.
PLACES = [
    (cls.task_id, place)
    for cls in map(tasks.get_task_class, tasks.list_clones())
    for place in cls.layout
    if place not in cls.needs or not cls.needs[place].joints
]
# Every place of every clone with every robot; the others as they are. One of them is quick.
EVERY = [(*place, robot) for place, robot in product(PLACES, ROBOTS)]
QUICK = [(*place, robot) for place, robot in zip(PLACES, cycle(ROBOTS), strict=False)]


@pytest.mark.parametrize(("task_id", "place", "robot"), quick_cases(EVERY, QUICK))
def test_it_builds_resets_and_steps(task_id: str, place: str, robot: str):
    env = tasks.make(task_id, num_envs=2, robots={place: robot})
    descriptor = RobotRegistry.load(robot)
    part = env.action_split[place]
    assert part.stop - part.start == descriptor.action_dim
    obs, _ = env.reset(seed=3)
    for name in env.layout:
        for kind in ("qpos", "qvel"):
            own = env.observation_slices[f"{name}.{kind}"]
            assert own.stop - own.start == env.layout[name].robot.dof
    own = obs[:, env.observation_slices[f"{place}.qpos"]]
    assert torch.equal(own, torch.from_numpy(env.simulation.read().qpos(place).copy()))
    for _ in range(2):
        obs, reward, terminated, _, info = env.step(env.action_space.sample())
        assert torch.isfinite(obs).all()
        assert torch.isfinite(reward).all()
        assert not terminated.any()
    assert obs.shape == env.observation_space.shape
    env.set_state_dict(env.get_state_dict())


def test_only_what_is_driven_moves():
    layout = face_to_face({"right": "panda", "left": "panda_stick"}, spacing=1.5)
    env = tasks.make("TwoRobotPickCube-v1", layout=layout)
    assert env.action_split == {"right": slice(0, 8), "left": slice(8, 15)}
    for driven, still in (("left", "right"), ("right", "left")):
        before, _ = env.reset(seed=0)
        action = torch.zeros(1, 15)
        action[:, env.action_split[driven]] = 0.5
        after = env.step(action)[0]
        moved = {
            name: (after - before)[:, env.observation_slices[f"{name}.qpos"]].abs().max()
            for name in (driven, still)
        }
        assert moved[driven] > 0.01 > moved[still]


def test_a_robot_without_the_joints_that_a_task_reads_is_refused():
    lacking = "'robot' needs the joints torso_joint, left_shoulder_roll_joint, right_shoulder_roll"
    with pytest.raises(TaskError, match=rf"{lacking}_joint, and it does not drive them"):
        tasks.make("UnitreeG1TransportBox-v1", robots="panda")


def test_other_places_are_refused():
    layout = face_to_face({"left": "panda", "rigth": "panda"}, spacing=1.5)
    with pytest.raises(TaskError, match=r"\['left', 'right'\]; the layout has \['left', 'rigth'\]"):
        tasks.make("TwoRobotPickCube-v1", layout=layout)
