"""Steering without a browser: targets become actions, episodes are taken back, kept, discarded."""

from threading import Lock

import numpy as np
import pytest
import torch

import tasks
from layouts import Layout, Placement
from robot_layouts.data.playing.replay import replay
from robot_layouts.data.reading.recording import FILE, Recording
from robot_layouts.data.recording.recorder import Recorder
from robot_layouts.data.teleop.session import Phase, Session
from robot_layouts.data.teleop.widgets import MOST_BEHIND, Pace
from robot_layouts.kinematics.rotations import inverse, multiply
from robots import RecordingError, TaskError, UnknownNameError
from tests.data.steering_hands import yaw_between

PICK, TWO = "PickCube-v1", "TwoRobotPickCube-v1"
LIMBS = Layout({"cell": Placement("mobile_panda_dual", position=(2.5, 0, 1.0), rpy=(0, 0, np.pi))})


@pytest.fixture(scope="module")
def pick():
    task = tasks.make(PICK)
    yield task
    task.close()


def go_on(session, steps):
    for _ in range(steps):
        session.step()


def missed(session, arm):
    """How far a TCP is from where it is to be (m, rad)."""
    wanted, came = session.targets[arm], session.steering.tcp(arm)
    turned = multiply(wanted[3:], inverse(came[3:]))
    return np.linalg.norm(wanted[:3] - came[:3]), 2 * np.arccos(min(1.0, abs(turned[0])))


def solve_pick(session):
    state = session.task.simulation.read()
    cube, goal = (state.pose(name)[0].astype(float) for name in ("cube", "goal_site"))
    yaw = yaw_between(session.targets["arm"][3:], cube[3:])
    session.start()
    session.shift("arm", cube[:3] + [0, 0, 0.1] - session.targets["arm"][:3], np.array([0, 0, yaw]))
    go_on(session, 20)
    session.shift("arm", np.array([0, 0, -0.1]))
    go_on(session, 15)
    session.grip("arm", True)
    go_on(session, 6)
    session.shift("arm", goal[:3] - cube[:3])
    go_on(session, 25)


@pytest.mark.parametrize(
    ("task_id", "making"),
    [
        (PICK, {"control_mode": "pd_joint_pos"}),
        (PICK, {"control_mode": "pd_joint_vel"}),
        (PICK, {"control_mode": "pd_ee_delta_pos"}),
        (TWO, {"control_mode": {"left": "pd_ee_pose", "right": "pd_joint_target_delta_pos"}}),
        (TWO, {"layout": LIMBS}),
        ("PushCube-v1", {"robots": "panda_stick"}),
        ("PushCube-v1", {"robots": "fetch"}),
    ],
    ids=str,
)
def test_tcps_go_where_they_are_to_be_in_any_control_mode(task_id, making):
    session = Session(tasks.make(task_id, **making))
    turning = session.steering.turned
    for sign, arm in zip((1, -1), session.arms, strict=False):
        session.shift(arm, np.array([0.0, 0.05 * sign, 0.03]))
        if arm in turning:
            session.shift(arm, turn=np.array([0.0, 0.0, 0.3]))
    go_on(session, 30)
    for arm in session.arms:
        place, turn = missed(session, arm)
        assert place < 0.002
        assert turn < 0.01 or arm not in turning
    session.task.close()


def test_arms_of_too_few_joints_reach_the_place_and_stay_calm():
    session = Session(tasks.make("PushCube-v1", robots="so100"))
    began = session.targets["arm"].copy()
    session.shift("arm", np.array([0.0, 0.03, 0.02]), np.array([0.3, 0.0, 0.0]))
    go_on(session, 60)
    assert missed(session, "arm")[0] < 0.003
    session.aim("arm", began)
    go_on(session, 60)
    assert missed(session, "arm")[0] < 0.003
    session.task.close()


def test_what_stops_an_arm_is_pushed_gently_and_the_arm_comes_back(pick):
    session = Session(pick)
    session.shift("arm", np.array([0.0, 0.0, -0.5]))
    go_on(session, 40)
    where = pick.simulation.read().joint_positions[0]
    assert np.abs(session.steering.reference - where)[:7].max() < 0.05
    session.shift("arm", np.array([0.0, 0.0, 0.5]))
    go_on(session, 40)
    assert missed(session, "arm")[0] < 0.002


def test_an_episode_is_steered_taken_back_and_kept(pick, tmp_path):
    with Recorder(tmp_path / FILE, pick, source="human") as recorder:
        session = Session(pick, recorder)
        solve_pick(session)
        assert session.success
        states, steps = pick.get_state_dict(), len(session.actions)
        session.stop()

        session.undo(steps - 10)
        assert session.phase is Phase.STOPPED
        assert len(session.actions) == steps - 10
        assert session.closed["arm"]
        go_on(session, 15)
        assert session.success
        assert len(session.actions) == steps + 5
        session.undo(steps + 5)
        assert len(session.actions) == steps + 5

        episode = session.keep()
        assert episode.solved
        assert len(episode.actions) == steps + 5
        assert session.kept == {0: True}
        assert (session.seed, session.phase, session.actions) == (1, Phase.READY, [])
        go_on(session, 3)
        session.undo(0)
        assert session.phase is Phase.READY
        assert not session.closed["arm"]
        session.skip()
        assert session.seed == 2
        assert Session(pick, recorder).seed == 1
    assert states["actors"].keys() == episode.states["actors"].keys()
    with Recording(tmp_path / FILE) as file:
        assert file[0].source == {"kind": "person", "name": "browser"}
        replayed = replay(pick, file[0])
        assert replayed.exact
        assert replayed.success
        assert replayed.difference is None


def test_an_earlier_moment_comes_back_to_the_last_bit(pick):
    session, seen = Session(pick, seed=3), []
    session.start()
    session.shift("arm", np.array([0.05, 0.1, -0.1]))
    for _ in range(20):
        seen.append(pick.simulation.read().all_poses.copy())
        session.step()
    shown = []
    session.on_replay = lambda done, steps: shown.append((done, steps))
    session.undo(12)
    np.testing.assert_array_equal(pick.simulation.read().all_poses, seen[12])
    assert shown[-1] == (12, 12)
    target = session.targets["arm"]
    np.testing.assert_array_equal(target, session._moments[11].targets["arm"])
    session.discard()
    np.testing.assert_array_equal(pick.simulation.read().all_poses, seen[0])
    assert session.seed == 3


def test_what_cannot_be_played_again_is_not_kept(pick, tmp_path):
    with Recorder(tmp_path / FILE, pick) as recorder:
        session = Session(pick, recorder)
        go_on(session, 5)
        pick.step(np.full((1, 8), 0.5, np.float32))  # behind the session's back
        go_on(session, 5)
        with pytest.raises(RecordingError, match="came out different when it was played again"):
            session.keep()
        assert len(recorder) == 0
        assert session.seed == 0


def test_what_makes_no_sense_is_refused(pick):
    session = Session(pick)
    with pytest.raises(UnknownNameError, match="arm that can be steered 'armm'. Did you mean"):
        session.grip("armm", True)
    pose = session.targets["arm"]
    for wrong, why in (
        (pose[:3], "a pose is 7 finite numbers"),
        (pose * np.nan, "a pose is 7 finite numbers"),
        (pose * 2, "the quaternion for arm is .*, which has length 2; a rotation"),
    ):
        with pytest.raises(TaskError, match=why):
            session.aim("arm", wrong)
    with pytest.raises(TaskError, match="there is nothing to keep"):
        session.keep()
    with pytest.raises(TaskError, match="steps 0 to 0; there is no 1"):
        session.undo(1)
    several = tasks.make(PICK, num_envs=2)
    with pytest.raises(TaskError, match="people steer in 1 environment; the task has 2"):
        Session(several)
    several.close()


def test_no_step_is_left_out():
    now = [0.0]
    pace = Pace(0.05, lambda: now[0])

    def run_until(end):
        steps = 0
        while now[0] < end - 1e-9:
            if pace.left() <= 1e-9:
                pace.stepped()
                steps += 1
            else:
                now[0] += 0.001
        return steps

    assert run_until(10.0) == 200
    now[0] += 0.8  # something holds it up; it catches up
    assert pace.behind
    assert run_until(60.0) == 1000
    assert pace.lost == 0
    now[0] += 3.0  # for too long: time goes slower
    steps = run_until(70.0)
    assert pace.lost == pytest.approx(3.0 - MOST_BEHIND, abs=0.06)
    assert steps * 0.05 + pace.lost == pytest.approx(10.0, abs=0.06)


def rises(observation):
    return np.array([[0, -0.3, 0, 0, 0, 0, 0, -1]], np.float32)


def test_a_person_takes_over_from_a_policy_and_gives_back(pick, tmp_path):
    with Recorder(tmp_path / FILE, pick) as recorder:
        session = Session(pick, recorder, policy=rises, policy_name="mylab:rises")
        go_on(session, 8)
        session.take_over()
        assert session.closed == {"arm": True}
        assert missed(session, "arm")[0] < 1e-6
        session.shift("arm", np.array([0.0, 0.05, 0.0]))
        go_on(session, 12)
        assert missed(session, "arm")[0] < 0.005
        session.give_back()
        go_on(session, 5)
        session.undo(10)
        assert session.by_hand
        session.undo(4)
        assert not session.by_hand
        go_on(session, 2)
        session.take_over()
        go_on(session, 3)
        session.keep()
        go_on(session, 2)
        assert session.keep().source["kind"] == "policy"
    with pytest.raises(TaskError, match="there is no policy to give the arms to"):
        Session(pick).give_back()
    with Recording(tmp_path / FILE) as file:
        mixed = file[0]
        assert mixed.source["kind"] == "mixed"
        assert [actor["name"] for actor in mixed.source["actors"]] == ["mylab:rises", "browser"]
        assert mixed.actor.tolist() == [0] * 6 + [1] * 3
        assert replay(pick, mixed).difference is None


class Fails:
    """Rises for three steps."""

    def __init__(self):
        self.steps = 0

    def __call__(self, observation):
        self.steps += 1
        if self.steps > 3:
            raise KeyError("layer9")
        return rises(observation)


def test_an_episode_outlives_a_policy_that_raises(pick):
    session = Session(pick, policy=Fails())
    go_on(session, 3)
    with pytest.raises(TaskError, match="^the policy failed: KeyError: 'layer9'$"):
        session.step()
    assert len(session.actions) == 3
    session.take_over()
    session.step()
    assert len(session.keep().actions) == 4
    session.step()  # the next episode has a policy that has not failed


def test_a_policy_that_learns_acts_as_in_an_evaluation(pick):
    weights = torch.zeros(8, requires_grad=True)
    session = Session(pick, policy=lambda observation: weights * 2)
    session.step()
    assert session.actions[0].tolist() == [0.0] * 8


def test_a_policy_that_cannot_be_copied_is_named(pick):
    class Locked:
        def __init__(self):
            self.lock = Lock()

        def __call__(self, observation):
            return np.zeros(8)

    with pytest.raises(TaskError, match="^the policy failed: TypeError: cannot pickle"):
        Session(pick, policy=Locked())
