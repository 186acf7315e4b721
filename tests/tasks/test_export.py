"""A task's world as a model for MuJoCo, opened by MuJoCo itself."""

import mujoco
import numpy as np
import pytest

import tasks
from layouts import single
from objects.solids import mass_of
from robot_layouts.__main__ import main
from robots import LayoutError
from tasks import Area, MultiRobotTask, Object, register_task

DIGITS = 1e-5  # MuJoCo writes six


def opened(path):
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("now").id)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize("simulator", ["sapien3", "mujoco"])
@pytest.mark.parametrize("task", ["PegInsertionSide-v1", "CellCloseDrawers-v1"])
def test_everything_is_where_it_is_in_the_task(task, simulator, tmp_path):
    env = tasks.make(task, simulator=simulator)
    env.reset(seed=3)
    for _ in range(5):
        env.step(np.full((1, env.layout.action_dim), 0.3, np.float32))
    model, data = opened(env.to_mjcf(tmp_path / "cell.xml"))
    bodies = [*env.simulation.worlds[0].bodies]
    for name in bodies:
        pose = env.state.pose(name)[0]
        np.testing.assert_allclose(data.body(name).xpos, pose[:3], atol=DIGITS)
        assert abs(data.body(name).xquat @ pose[3:]) > 1 - 1e-6
    for place, placement in env.layout.items():
        joints = [data.joint(f"{place}/{joint}").qpos[0] for joint in placement.robot.joints]
        np.testing.assert_allclose(joints, env.state.qpos(place)[0], atol=DIGITS)
        assert all(model.actuator(f"{place}/{joint}") for joint in placement.robot.joints)


class ShutLaptop(MultiRobotTask):
    """A laptop with a screen that rubs."""

    layout = single({"arm": "panda"})
    max_episode_steps = 20
    laptop = Object("laptop", spawn=Area(x=0.1, y=0.1), joints={"screen": 1.0})

    def evaluate(self, state):
        """Success: it is shut."""
        return {"success": state.joint("laptop", "screen") < 0.1}


def test_it_weighs_and_rubs_as_it_does_here_and_stands_still(tmp_path):
    register_task("TestShutLaptop-v1")(ShutLaptop)
    env = tasks.make("TestShutLaptop-v1")
    env.reset(seed=0)
    model, data = opened(env.to_mjcf(tmp_path / "cell.xml"))
    body = env.simulation.worlds[0].bodies["laptop"]
    (joint,) = body.joints
    screen = model.body("laptop.screen")
    assert model.body("laptop").mass[0] == pytest.approx(mass_of(body.shapes).mass, rel=0.01)
    assert screen.mass[0] == pytest.approx(mass_of(joint.parts).mass, rel=0.01)
    rubs = joint.friction * screen.subtreemass[0] * 9.81
    assert model.dof_frictionloss[screen.dofadr[0]] == pytest.approx(rubs, rel=1e-3) != 0
    before = data.body("laptop").xpos.copy()
    mujoco.mj_step(model, data, nstep=round(1 / model.opt.timestep))
    assert np.abs(data.body("laptop").xpos - before).max() < 1e-3


def test_the_command(tmp_path, capsys):
    path = tmp_path / "bar.xml"
    assert main(["tasks", "export", "TwoRobotLiftBar-v1", "--seed", "1", "--out", str(path)]) == 0
    assert f"model: {path}" in capsys.readouterr().out
    model, data = opened(path)
    assert data.body("bar").xpos[2] < 0.1
    assert "panda" in (tmp_path / "bar_assets" / "LICENCES.md").read_text()


def test_another_ending_is_refused_and_nothing_is_left(tmp_path):
    env = tasks.make("PushCube-v1")
    env.reset(seed=0)
    with pytest.raises(LayoutError, match="must end in .xml"):
        env.to_mjcf(tmp_path / "cell.usd")
    assert not list(tmp_path.iterdir())
