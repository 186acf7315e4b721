"""Things with joints in tasks: where they begin; recorded, played again, exported, shown."""

from dataclasses import replace

import numpy as np
import pytest

import tasks
from layouts import single
from objects import ObjectRegistry
from robot_layouts.__main__ import main
from robot_layouts.data.export.columns import ColumnReader
from robot_layouts.data.reading.recording import Recording
from robot_layouts.experts import thing_grips
from robot_layouts.experts.obstacles import obstacles
from robot_layouts.experts.script import Scene
from robots import DescriptorError, TaskError, UnknownNameError
from tasks import Area, Fixed, MultiRobotTask, Object, Randomization, register_task
from tasks.view import recorded_motion, task_cell
from tests.tasks.own import recorded

ID = "TestOpenUp-v1"


class OpenUp(MultiRobotTask):
    """A drawer that stands, and a box with a lid that does not."""

    layout = single({"arm": "panda"})
    max_episode_steps = 20

    case = Object(
        "drawer",
        kind="kinematic",
        spawn=Area(x=(0.1, 0.2), y=-0.2, yaw=(3.0, 3.2)),
        joints={"drawer": (0.02, 0.1)},
    )
    box = Object("hinged_box", spawn=Area(x=0.0, y=0.3), joints={"lid": 0.8})

    def evaluate(self, state):
        """Success: the drawer is open."""
        return {"success": state.joint("case", "drawer") > 0.09}


@pytest.fixture(scope="module", autouse=True)
def _registered():
    register_task(ID)(OpenUp)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return recorded(ID, tmp_path_factory.mktemp("jointed"))


def test_joints_begin_where_they_are_drawn_and_go_on_by_physics():
    env = tasks.make(ID, num_envs=2)
    env.reset(seed=0)
    start = env.state.joint("case", "drawer")
    assert ((start >= 0.02) & (start <= 0.1)).all()
    assert start[0] != start[1]
    assert env.state.joint("box", "lid") == pytest.approx(0.8)
    case, drawer = env.state.pose("case"), env.state.pose("case.drawer")
    assert np.linalg.norm(drawer[:, :3] - case[:, :3], axis=1) == pytest.approx(start, abs=1e-6)
    for _ in range(20):
        env.step(np.zeros((2, 8)))
    assert np.array_equal(env.state.pose("case"), case)
    assert env.state.joint("case", "drawer") == pytest.approx(start, abs=1e-3)
    assert env.state.joint("box", "lid") == pytest.approx(0.0, abs=1e-3)
    env.reset(seed=0)
    assert np.array_equal(env.state.joint("case", "drawer"), start)


def test_a_state_holds_joints_and_puts_them_back():
    env = tasks.make(ID)
    env.reset(seed=1)
    for _ in range(3):
        env.step(np.zeros((1, 8)))
    kept = env.get_state_dict()
    assert set(kept["actors"]).isdisjoint({"case", "box", "case.drawer", "box.lid"})
    assert kept["articulations"]["box"].shape == (1, 15)
    lid = env.state.joint("box", "lid").copy()
    env.reset(seed=2)
    env.set_state_dict(kept)
    assert np.array_equal(env.state.joint("box", "lid"), lid)
    kept["articulations"]["box"][0, 13] = 1e3
    with pytest.raises(TaskError, match="articulations/box: qpos of lid is 1000"):
        env.set_state_dict(kept)


def test_a_recording_is_played_again_to_the_last_bit(recording, capsys):
    assert main(["replay", str(recording)]) == 0
    assert "in 2 all states are equal to the last b" in " ".join(capsys.readouterr().out.split())


def test_exports_and_pages_know_where_parts_were(recording):
    task = tasks.make(ID, obs_mode="none")
    task.reset(seed=3)
    with Recording(recording) as file:
        trajectory = file[0]
    reader = ColumnReader(task)
    assert reader.bodies == ["case", "case.drawer", "box", "box.lid"]
    columns = reader.read(trajectory)
    assert columns.bodies.shape == (21, 28)
    seen = np.concatenate([task.state.pose(name)[0] for name in reader.bodies])
    assert columns.bodies[0] == pytest.approx(seen, abs=1e-6)
    motion = recorded_motion(task, columns.states)
    assert set(motion.poses) >= set(reader.bodies)
    assert set(reader.bodies) <= set(task_cell(task, "it").things)


def test_obstacles_and_grips_go_with_the_parts():
    env = tasks.make(ID)
    env.reset(seed=0)
    scene = Scene(env.task)
    found = obstacles(scene)
    assert {"case", "case.drawer", "box", "box.lid"} <= set(found)
    thing = ObjectRegistry.load("drawer")
    (place, _), *_ = thing_grips(thing, "case", 0.08, lean=np.pi)(scene)
    closed = replace(thing, joints=())
    (other, _), *_ = thing_grips(closed, "case", 0.08, lean=np.pi)(scene)
    opened = env.state.joint("case", "drawer")[0]
    assert np.linalg.norm(place - other) == pytest.approx(opened, abs=1e-6)


def test_a_larger_thing_begins_as_far_open_and_its_parts_have_no_size_of_their_own():
    env = tasks.make(ID, randomization=Randomization(size={"case": Fixed(1.5)}))
    env.reset(seed=0)
    plain = tasks.make(ID)
    plain.reset(seed=0)
    opened = [task.state.joint("case", "drawer")[0] for task in (env, plain)]
    assert opened[0] == pytest.approx(1.5 * opened[1], rel=1e-6)
    with pytest.raises(UnknownNameError, match="case.drawer"):
        tasks.make(ID, randomization=Randomization(size={"case.drawer": Fixed(1.5)}))


@pytest.mark.parametrize(
    ("joints", "error", "message"),
    [
        ({"lid": 0.1}, UnknownNameError, "unknown joint of drawer 'lid'"),
        ({"drawer": 9.0}, DescriptorError, "joint drawer is 9.0; it must be a number from 0 to"),
        ({"drawer": (0.1, 0.0)}, TaskError, r"Object: joint drawer is \(0.1, 0.0\); it takes a fi"),
        ({"drawer": "open"}, TaskError, "Object: joint drawer is 'open'; it takes a number"),
    ],
)
def test_where_no_joint_can_begin_is_refused_where_it_is_declared(joints, error, message):
    with pytest.raises(error, match=f"^{message}"):
        Object("drawer", joints=joints)
