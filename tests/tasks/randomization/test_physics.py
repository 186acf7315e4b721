"""Every axis by a physical measurement of its effect."""

import math
from typing import Any

import numpy as np
import pytest
import torch

import tasks
from robot_layouts.simulation.sapien3.backend import worlds_below
from tasks import Fixed, Normal, Randomization, Shift, TaskEnv, Whole

TASK = "PickCube-v1"
ARM_MOVES = torch.tensor([[1.0, 0, 0, 0, 0, 0, 0, 0]])
STILL = torch.zeros(1, 8)
GRAVITY = 9.81
HALF = 0.02  # m, of the cube
TIMESTEP = 0.01  # s


def made(randomization: Randomization | None = None, **making: Any) -> TaskEnv:
    env = tasks.make(TASK, randomization=randomization, **making)
    env.reset(seed=0)
    return env


def cube_of(env: TaskEnv) -> Any:
    return worlds_below(env.simulation)[0].bodies["cube"]


def throw(env: TaskEnv, position: tuple[float, float, float], velocity: float) -> None:
    """Put the cube somewhere, moving along y (m/s)."""
    state = env.get_state_dict()
    row = [*position, 1.0, 0.0, 0.0, 0.0, 0.0, velocity, 0.0, 0.0, 0.0, 0.0]
    state["actors"]["cube"] = torch.tensor([row])
    env.set_state_dict(state)


def cube_place(env: TaskEnv) -> Any:
    return env.simulation.read().pose("cube")[0, :3]


@pytest.mark.parametrize("factor", [0.5, 1.0, 3.0])
def test_a_heavier_body_accelerates_less_under_the_same_force(factor: float) -> None:
    env = made(Randomization(mass={"cube": Fixed(factor)}))
    force, torque = 0.3, 1e-4  # N, N·m
    body = cube_of(env)
    throw(env, (0.3, 0.3, 1.0), 0.0)
    body.component.add_force_torque([0.0, force, 0.0], [0.0, 0.0, torque])
    worlds_below(env.simulation)[0].system.step()
    mass = 1000 * (2 * HALF) ** 3 * factor
    inertia = mass * (2 * HALF) ** 2 / 6
    assert body.component.linear_velocity[1] == pytest.approx(force / mass * TIMESTEP, rel=1e-3)
    assert body.component.angular_velocity[2] == pytest.approx(
        torque / inertia * TIMESTEP, rel=0.02
    )


def test_heavier_links_lag_behind_their_drives() -> None:
    ways: list[float] = []
    for factor in (0.2, 1.0, 5.0):
        env = made(Randomization(mass={"arm": Fixed(factor)}))
        start = env.simulation.read().qpos("arm")[0, 0]
        env.step(ARM_MOVES)
        ways.append(float(env.simulation.read().qpos("arm")[0, 0] - start))
    assert ways[0] > ways[1] > ways[2] > 0


@pytest.mark.parametrize("coefficient", [0.1, 0.3, 0.8])
def test_a_body_slides_as_far_as_friction_lets_it(coefficient: float) -> None:
    both = {"cube": Fixed(coefficient), "table-workspace": Fixed(coefficient)}
    env = made(Randomization(friction=both))
    speed = 0.8
    throw(env, (0.2, -0.5, HALF), speed)
    start = cube_place(env)[1]
    for _ in range(30):
        env.step(STILL)
    slowing = coefficient * GRAVITY
    expected = speed**2 / (2 * slowing) - speed * TIMESTEP / 2  # braked in steps of time
    assert cube_place(env)[1] - start == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("strength", [1.62, 9.81, 20.0])
def test_bodies_fall_with_the_gravity_drawn(strength: float) -> None:
    env = made(Randomization(gravity=Fixed(strength)))
    throw(env, (0.2, 0.3, 3.0), 0.0)
    for _ in range(6):
        env.step(STILL)
    fallen = 6 * env.simulation.substeps * TIMESTEP
    assert env.simulation.worlds[0].physics.gravity == (0.0, 0.0, -strength)
    assert cube_of(env).component.linear_velocity[2] == pytest.approx(-strength * fallen, rel=1e-4)


def time_constant(randomization: Randomization | None) -> float:
    """Return in what time (s) the first joint comes nearer to its target by a factor e."""
    env = made(randomization, control_mode="pd_joint_pos")
    qpos = env.simulation.read().qpos("arm")[0].copy()
    action = torch.from_numpy(np.append(qpos[:7], 1.0)[None].astype(np.float32))
    action[0, 0] += 0.3
    away: list[float] = []
    for _ in range(14):
        env.step(action)
        away.append(float(action[0, 0] - env.simulation.read().qpos("arm")[0, 0]))
    return (13 - 5) * 0.05 / math.log(away[5] / away[13])


def test_stiffer_drives_are_quicker_and_damped_ones_slower() -> None:
    # Where damping rules, a drive comes nearer with the time constant damping / stiffness.
    damped = time_constant(Randomization(damping={"arm": Fixed(8.0)}))
    assert damped == pytest.approx(8 * 0.1, rel=0.1)
    both = Randomization(damping={"arm": Fixed(8.0)}, stiffness={"arm.arm": Fixed(2.0)})
    assert time_constant(both) == pytest.approx(8 * 0.1 / 2, rel=0.1)
    one = Randomization(damping={"arm.panda_joint1": Fixed(4.0)})
    assert time_constant(one) == pytest.approx(4 * 0.1, rel=0.1)


def test_friction_in_a_joint_holds_it_back() -> None:
    ways: list[float] = []
    for coefficient in (0.0, 0.5, 5.0):
        env = made(Randomization(joint_friction={"arm.panda_joint1": Fixed(coefficient)}))
        start = env.simulation.read().qpos("arm")[0, 0]
        env.step(ARM_MOVES)
        ways.append(float(env.simulation.read().qpos("arm")[0, 0] - start))
    assert ways[0] > ways[1] > ways[2]


@pytest.mark.parametrize("factor", [0.5, 1.0, 1.6])
def test_a_larger_body_lies_higher_and_weighs_more(factor: float) -> None:
    env = made(Randomization(size={"cube": Fixed(factor)}))
    start = cube_place(env)[2]
    for _ in range(10):
        env.step(STILL)
    assert cube_place(env)[2] == pytest.approx(HALF * factor, abs=1e-4)
    assert start == pytest.approx(HALF * factor, abs=1e-6)  # it neither falls nor is pushed out
    assert cube_of(env).component.mass == pytest.approx(0.064 * factor**3, rel=1e-5)
    assert float(env.scale("cube")[0]) == np.float32(factor)


def test_bases_stand_where_they_were_drawn() -> None:
    shift = Shift(x=Fixed(0.03), y=Fixed(-0.02), z=Fixed(0.01), yaw=Fixed(0.2))
    plain, env = made(), made(Randomization(bases={"arm": shift}))
    base = np.array(plain.layout["arm"].base_position)
    before = plain.simulation.read().tcp_pose("arm")[0, :3] - base
    cos, sin = math.cos(0.2), math.sin(0.2)
    turned = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]]) @ before
    expected = base + (0.03, -0.02, 0.01) + turned
    np.testing.assert_allclose(env.simulation.read().tcp_pose("arm")[0, :3], expected, atol=1e-6)
    stands = env.standing()["arm"].base_position
    np.testing.assert_allclose(stands, base + (0.03, -0.02, 0.01), atol=1e-12)
    assert env.layout == plain.layout
    solver = env.simulation.backend.inverse_kinematics("arm")
    qpos = env.simulation.read().qpos("arm")[0, :7]
    np.testing.assert_allclose(solver.forward(qpos)[0], expected, atol=1e-5)


def played(env: TaskEnv, steps: int) -> tuple[list[Any], list[Any]]:
    """Return observations and joint positions of some steps."""
    rng = np.random.default_rng(0)
    seen, joints = [env.reset(seed=0)[0]], [env.simulation.read().qpos("arm").copy()]
    for _ in range(steps):
        seen.append(env.step(rng.uniform(-0.3, 0.3, (1, 8)).astype(np.float32))[0])
        joints.append(env.simulation.read().qpos("arm").copy())
    return seen, joints


@pytest.mark.parametrize("mode", ["state", "state_dict"])
def test_sensor_noise_has_its_deviation_and_leaves_physics_alone(mode: str) -> None:
    noise = {"arm.qpos": Normal(0.01), "*_pose": Normal(0.002, 0.1)}
    plain, env = made(obs_mode=mode), made(Randomization(sensor_noise=noise), obs_mode=mode)
    (exact, joints), (seen, same) = played(plain, 60), played(env, 60)
    np.testing.assert_array_equal(joints, same)

    def differences(name: str) -> Any:
        if mode == "state":
            part = env.observation_slices[name]
            pairs = [(a[:, part], b[:, part]) for a, b in zip(seen, exact, strict=True)]
        else:
            tree, key = ("agent", name[4:]) if name.startswith("arm.") else ("extra", name)
            pairs = [(a[tree][key], b[tree][key]) for a, b in zip(seen, exact, strict=True)]
        return np.array([(a - b).numpy() for a, b in pairs])

    for name, mean, std in (("arm.qpos", 0.0, 0.01), ("tcp_pose", 0.1, 0.002)):
        found = differences(name)
        assert found.std() == pytest.approx(std, rel=0.15)
        assert found.mean() == pytest.approx(mean, abs=4 * std / found.size**0.5)
    assert not differences("arm.qvel").any()
    assert not differences("goal_pos").any()


def test_action_noise_reaches_the_drives_and_spares_the_rest() -> None:
    env, plain = made(Randomization(action_noise={"arm.arm": Normal(0.05)})), made()
    found: list[Any] = []
    for _ in range(40):
        targets = []
        for one in (env, plain):
            before = one.simulation.read().joint_positions.copy()
            one.step(STILL)
            targets.append(one.simulation.drive_targets - before)
        found.append(targets[0] - targets[1])
    scale = 0.1  # rad per unit of an action number of this mode
    assert np.array(found)[..., :7].std() == pytest.approx(0.05 * scale, rel=0.15)
    assert np.abs(np.array(found)[..., 7:]).max() < 1e-3


@pytest.mark.parametrize("delay", [0, 1, 3])
@pytest.mark.parametrize("mode", ["pd_joint_delta_pos", "pd_joint_pos", "pd_ee_delta_pose"])
def test_actions_take_effect_after_their_delay(delay: int, mode: str) -> None:
    env = made(Randomization(action_delay=Whole(delay, delay)), control_mode=mode)
    start = env.simulation.read().qpos("arm")[0].copy()
    action = np.zeros((1, env.single_action_space.shape[0]), np.float32)  # type: ignore[index]
    action[0, :7] = start[:7] + 0.2 if mode == "pd_joint_pos" else 0.5
    ways: list[float] = []
    for _ in range(6):
        env.step(action)
        ways.append(float(np.abs(env.simulation.read().qpos("arm")[0] - start)[:7].max()))
    assert [way > 5e-3 for way in ways] == [step >= delay for step in range(6)]


def test_delayed_actions_go_on_where_others_began() -> None:
    late, plain = made(Randomization(action_delay=Whole(2, 2)), num_envs=2), made()
    for _ in range(5):  # of which two pass before the first action arrives
        late.step(ARM_MOVES.tile(2, 1))
    late.step(STILL.tile(2, 1), env_ids=[1])
    state = late.simulation.read().qpos("arm")
    for _ in range(3):
        plain.step(ARM_MOVES)
    assert state[0, 0] == pytest.approx(plain.simulation.read().qpos("arm")[0, 0], abs=1e-3)
    assert state[1, 0] > state[0, 0]  # which moved one step more


@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("mode", ["state", "state_dict"])
def test_observations_are_as_old_as_drawn(delay: int, mode: str) -> None:
    late = Randomization(observation_delay=Whole(delay, delay))
    exact, _ = played(made(obs_mode=mode), 8)
    seen, _ = played(made(late, obs_mode=mode), 8)
    for step, observation in enumerate(seen):
        expected = exact[max(step - delay, 0)]
        if mode == "state_dict":
            observation, expected = observation["agent"]["qpos"], expected["agent"]["qpos"]
        assert torch.equal(observation, expected)
