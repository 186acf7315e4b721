"""A task as a Gymnasium vector of thousands of environments on one device, of torch's tensors."""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, NoReturn

import numpy as np
import torch
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from torch import Tensor

from robot_layouts.core.bounds import checked_whole, shown
from robot_layouts.simulation.mujoco_warp.state import beside
from robots import ActionError, SimulationError, TaskError
from tasks.engine import outcome
from tasks.engine.actions import given_robots
from tasks.engine.checks import SEED, SUCCESS, checked_options, checked_seeds
from tasks.engine.env import TaskEnv
from tasks.engine.observation import JOINTS, STATE_FORMS, TIPS, tip_links
from tasks.engine.outcome import ELAPSED, SOLVED
from tasks.engine.remade import Remade
from tasks.engine.scenario import Scenario
from tasks.engine.task import Info, Memory, Task
from tasks.interfaces.vector import checked_mode
from tasks.language.stages import STAGE, STAGE_SCORE
from tasks.native import controllers
from tasks.native.format import observation_keys
from tasks.registry import get_task_class, make_scenario

STARTS = 1024
VARIED = ("bases", "damping", "friction", "mass", "spread", "stiffness")  # axes of randomization
DIVERGED, OVERFLOWED = "diverged", "overflowed"  # in info
PHRASING = "phrasing"  # in info: which of a task's instructions an episode has


class _Given(NamedTuple):
    """Episodes whose seeds are given.

    Attributes:
        starts: Those that are kept, and theirs.
        flags: Which worlds have one, (N,) bool.
        rows: The numbers of their starts, (N,) int64.
        seeds: The seeds, (N,) int64.
    """

    starts: Any
    flags: Tensor
    rows: Tensor
    seeds: Tensor


class DeviceTask(Remade, VectorEnv[Any, Any, Any]):
    """What ``gymnasium.make_vec(…, simulator="mujoco_warp", device="cuda:0")`` gives; experimental.

    All that it returns are tensors of the device, and `step` never waits for that. The worlds are
    those of ``simulator="mujoco"``, in float32. The starts of ``starts`` seeds are drawn once, by
    the task itself, and kept on the device; each episode has one of them, chosen there by a
    counter-based generator of the environment's seed and the number of the episode. Only the
    episode of a seed that `reset` is given has that seed's own start. ``info["seed"]`` is the seed
    whose start it is: ``tasks.make(…, simulator="mujoco").reset(seed=…)`` begins alike. Of tasks
    with several instructions, ``info["phrasing"]`` tells which each has, (N,).

    An environment whose physics diverges is truncated, with an observation and a reward of 0, and
    flagged in ``info["diverged"]``; ``info["overflowed"]`` flags those in which contacts were left
    out for lack of room. Whether actions are finite is not looked at, as that would wait.

    Attributes:
        num_envs: Number of environments N.
        device: Where they are.
        autoreset_mode: What happens after an episode's last step.
        action_split: Robot name → slice of one environment's action.
        task: The task, an instance of the class that a user declared.
        seeds: Seeds whose starts are kept.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": [], "render_fps": 20}

    def __init__(
        self,
        task_id: str,
        num_envs: int = 1,
        device: str | torch.device = "cuda:0",
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        ignore_terminations: bool = False,
        starts: int = STARTS,
        first_seed: int | None = None,
        contacts: int | None = None,
        **fields: Any,
    ) -> None:
        """Draw the starts, and put the worlds on the device.

        Args:
            task_id: The task's id or another of its names.
            num_envs: Number of environments.
            device: ``"cuda:0"``, or ``"cpu"``, where the same runs slowly.
            autoreset_mode: As of `tasks.interfaces.vector.VectorTask`; with ``SAME_STEP``,
                ``final_obs`` and ``final_info`` are of all environments, and ``_final_obs`` says
                which have ended.
            ignore_terminations: Whether nothing ends an episode but its last step.
            starts: How many starts are kept on the device.
            first_seed: Seed of the first of them; None takes the task's.
            contacts: How many contacts each world has room for; None for enough for hands.
            fields: Other arguments of `tasks.make`.

        Raises:
            UnknownNameError: If the task, a place, a robot or a field is unknown.
            TaskError: If the task cannot be made like that, or not on a device.
            SimulationError: If there is no such device, or it has too little memory.
            MissingPackageError: If MuJoCo Warp is not installed.
            AssetError: If robot files cannot be found.
        """
        self.autoreset_mode = checked_mode(autoreset_mode)
        self.device = on = _checked_device(device)
        self.num_envs = count = checked_whole("num_envs", num_envs, 1, None, TaskError)
        kept = checked_whole("starts", starts, 1, None, TaskError)
        cls = get_task_class(task_id)
        making: Any = {**fields, "simulator": "mujoco"}
        scenario = make_scenario(cls, 1, **making)
        _refuse(scenario)
        from robot_layouts.simulation.mujoco_warp.simulation import DeviceSimulation
        from robot_layouts.simulation.mujoco_warp.worlds import Starts

        first = cls.first_seed if first_seed is None else first_seed
        self._host = host = cls(scenario, first_seed=first)
        _refuse_task(host)
        self._draw = lambda seeds: Starts.of(map(self._start, seeds), on)
        self.seeds = range(first, first + kept)
        self._starts = self._draw(self.seeds).without_constants(self._world.as_built)
        self._simulation = DeviceSimulation(host.simulation, self._starts, count, contacts=contacts)
        self._elapsed = torch.zeros(count, dtype=torch.int32, device=on)
        self._started = started = torch.zeros(count, dtype=torch.int64, device=on)  # of which seed
        self.task = task = object.__new__(cls)
        vars(task).update(vars(host.task))
        vars(task).update(
            num_envs=count,
            simulation=self._simulation,
            moving=range(count),
            memory=Memory(),
            _rngs=_NoStreams(cls.__name__),
            _chosen_phrasings=started.remainder,
            _elapsed=self._elapsed,
            _randomizer=None,
        )
        self.action_split, self._mode = host.action_split, host.observer.mode
        self._keys, self._kept = observation_keys(host.layout), controllers.entries(host.simulation)
        self._tips = tip_links(host.layout)
        self._responds, self._ignores = cls.respond is not Task.respond, ignore_terminations
        self._scores = torch.tensor([0.0, *task.stages.values()], device=on)
        self._seeds = torch.arange(count, device=on) + secrets.randbelow(2**32 - count)
        self._episodes = torch.full_like(self._seeds, -1)
        self._passed = torch.zeros_like(self._seeds)
        self._nowhere = torch.zeros(count, dtype=torch.bool, device=on)
        self._over = self._nowhere
        self._ungiven = _Given(self._starts, self._nowhere, self._started, self._started)
        self._reward_mode = scenario.reward_mode or task.reward_modes[0]
        self.metadata = {  # type: ignore[misc]
            **self.metadata,
            "autoreset_mode": self.autoreset_mode,
            "render_fps": round(scenario.control_frequency),
        }
        self.single_action_space = host.single_action_space
        self.action_space = batch_space(self.single_action_space, count)
        self.single_observation_space = host.single_observation_space
        self.observation_space = batch_space(self.single_observation_space, count)
        self._restart(~self._nowhere)
        self._info(self._look(~self._nowhere))  # a task that cannot be judged here says so

    # -- episodes ----------------------------------------------------------------------------

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Begin new episodes.

        Args:
            seed: ``k`` seeds environment i with k + i; a list gives each its own; None goes on to
                the next episode, at first of seeds that the system's entropy gives.
            options: ``{"reset_mask": mask}`` resets only where the mask, (N,) bool, is true, an
                array or a tensor. Others are ignored.

        Returns:
            Observation and info of all environments.

        Raises:
            TaskError: If an argument is not valid; nothing is reset then.
        """
        where = self._checked_mask(checked_options(options).get("reset_mask"))
        seeds = None if seed is None else checked_seeds(seed, range(self.num_envs))
        if seed is None or isinstance(seed, int):
            super().reset(seed=seed)
        self._restart(where, seeds)
        state = self._look(where)
        self._over = self._over & ~where
        info = self._info(state)
        return self._observation(state, info), info

    def step(self, actions: Any) -> tuple[Any, Tensor, Tensor, Tensor, dict[str, Any]]:
        """Advance every environment by one control step.

        Args:
            actions: (N, A) floating, in the order of ``action_split``, a tensor or an array; or a
                mapping robot name → (N, a).

        Returns:
            Observation, reward (N,) float32, terminated (N,), truncated (N,) and info.

        Raises:
            ActionError: If the action has a wrong shape or type; nothing moves then.
        """
        action, mode = self._read(actions), self.autoreset_mode
        self._simulation.step(action, self._state)
        self._elapsed += 1
        if self._responds:
            self.task.respond(self._simulation.read())
        begun = self._over if mode is AutoresetMode.NEXT_STEP else self._nowhere
        if mode is AutoresetMode.NEXT_STEP:
            self._restart(begun)
        state = self._look(begun)
        info = self._info(state)
        lost = info[DIVERGED]
        obs = _each(self._observation(state, info), lambda part: _zeroed(part, lost))
        reward = _zeroed(self._reward(state, action, info), lost | begun)
        ended = lost | (self._elapsed >= self.task.max_episode_steps)
        terminated = (outcome.ended(info) & ~(lost | begun)) if not self._ignores else self._nowhere
        truncated = ended & ~begun
        self._over = over = terminated | truncated
        if mode is AutoresetMode.SAME_STEP:
            final = {"final_obs": obs, "final_info": info, "_final_obs": over, "_final_info": over}
            self._restart(over)
            state = self._look(over)
            info = self._info(state)
            obs, info = self._observation(state, info), {**info, **final}
        return obs, reward, terminated, truncated, info

    @property
    def state(self) -> Any:
        """What all worlds look like now, as tensors; see `robot_layouts.simulation.State`."""
        return self._state

    def close_extras(self, **kwargs: Any) -> None:
        """Let the worlds go."""
        self._host.close()
        for holder in ("_simulation", "_state", "_starts", "task"):
            vars(self).pop(holder, None)

    # -- inside ------------------------------------------------------------------------------

    def _start(self, seed: int) -> Any:
        """Return MuJoCo's world, in which an episode has begun that has a seed."""
        self._host.reset(seed)
        return self._world

    @property
    def _world(self) -> Any:
        backend: Any = self._host.simulation.backend
        return backend.worlds[0]

    def _restart(self, where: Tensor, seeds: Sequence[int | None] | None = None) -> None:
        """Begin episodes in some worlds, each with the start of its seed if that is given."""
        starts, given, rows, own = self._ungiven if seeds is None else self._given(seeds)
        given = given & where
        self._seeds = torch.where(given, own, self._seeds)
        self._episodes = (self._episodes + where).masked_fill(given, 0)
        row = chosen(self._seeds, self._episodes, len(self.seeds))
        begun = torch.where(given, own, self.seeds[0] + row)
        self._started.copy_(torch.where(where, begun, self._started))
        self._simulation.begin(where, starts.take(torch.where(given, rows, row)))
        self._elapsed.masked_fill_(where, 0)
        self._passed.masked_fill_(where, 0)

    def _given(self, seeds: Sequence[int | None]) -> _Given:
        """Look up the starts of seeds, and draw those that are not kept."""
        more = sorted({seed for seed in seeds if seed is not None} - set(self.seeds))
        starts = self._starts.and_then(self._draw(more)) if more else self._starts
        places = {seed: row for row, seed in enumerate([*self.seeds, *more])}
        known = [0 if seed is None else seed for seed in seeds]
        columns = [seed is not None for seed in seeds], [places.get(s, 0) for s in known], known
        return _Given(starts, *(torch.tensor(column, device=self.device) for column in columns))

    def _look(self, begun: Tensor) -> Any:
        """Read the worlds, of which some have just begun an episode."""
        state = self._state = self._simulation.read()
        self._simulation.hold(state, begun)
        memory = self.task.memory
        remembered: Mapping[str, Any] = self.task.remember(state)
        for name, fresh in remembered.items():
            before = vars(memory).get(name, fresh)
            setattr(memory, name, torch.where(beside(begun, fresh), fresh, before))
        return state

    def _info(self, state: Any) -> Info:
        info: Info = {ELAPSED: self._elapsed.clone(), **self.task.evaluate(state)}
        if flags := [info[name] for name in self.task.stages]:
            for number, flag in enumerate(flags):
                self._passed += (self._passed == number) & flag
            self._passed.masked_fill_(flags[-1], len(flags))
            info |= {STAGE: self._passed.clone(), STAGE_SCORE: self._scores[self._passed]}
        if isinstance(said := self.task.instruction, tuple):
            info[PHRASING] = self._started % len(said)
        finite = state.all_poses.isfinite().all(-1).all(0) & state.joint_velocities.isfinite().all(
            1
        )
        return info | {
            DIVERGED: ~finite,
            OVERFLOWED: self._simulation.bodies.overflowed,
            SEED: self._started.clone(),
            **({SUCCESS: info[SOLVED]} if SOLVED in info else {}),
        }

    def _observation(self, state: Any, info: Info) -> Any:
        if self._mode.nothing:
            return torch.empty((self.num_envs, 0), device=self.device)
        robots = {name: state.native_joints(name) for name in self._keys}
        recalled: list[Any] = self._simulation.control.recall() if self._kept else []
        for entry in self._kept:
            rows = torch.cat([recalled[part] for part in entry.parts], 1)
            order = self._simulation.index.native[entry.robot] if entry.joints else None
            robots[entry.robot].append(rows if order is None else rows[:, order])
        for name, links in self._tips.items():
            robots[name].append(state.link_poses(name, links))
        parts: dict[str, Any] = self.task.observe(state, info)
        if not self._mode.flat:
            return self._named(robots, parts)
        rows = [row for own in robots.values() for row in own]
        rows += [part if part.ndim == 2 else part[:, None] for part in parts.values()]
        return torch.cat([row.float() for row in rows], 1)

    def _named(self, robots: Mapping[str, Sequence[Tensor]], parts: Mapping[str, Tensor]) -> Any:
        agent: dict[str, Any] = {}
        for (name, key), own in zip(self._keys.items(), robots.values(), strict=True):
            kept = [f"{controllers.CONTROLLER}/{e.key}" for e in self._kept if e.robot == name]
            tips = (TIPS,) if name in self._tips else ()
            tree = controllers.nested(dict(zip((*JOINTS, *kept, *tips), own, strict=True)))
            agent.update(tree if key is None else {key: tree})
        return {"agent": agent, "extra": dict(parts)}

    def _reward(self, state: Any, action: Any, info: Info) -> Tensor:
        if self._reward_mode == "sparse":
            return outcome.sparse(info).float()
        if self._reward_mode == "none":
            return torch.zeros(self.num_envs, device=self.device)
        reward: Any = self.task.dense_reward(state, action, info)
        share = self.task.max_reward if self._reward_mode == "normalized_dense" else 1.0
        return (reward.double() if self.task.double_rewards else reward.float()) / share

    # -- checks ------------------------------------------------------------------------------

    def _read(self, actions: Any) -> Tensor:
        """Return an action as (N, A) float32 on the device."""
        if isinstance(actions, Mapping):
            robots = given_robots(actions, self.action_split)
            actions = torch.cat([self._tensor(actions[name]) for name in robots], 1)
        action = self._tensor(actions)
        if action.shape != self.action_space.shape:
            raise ActionError(
                f"the action has shape {tuple(action.shape)}; it must be {self.action_space.shape}"
            )
        return action

    def _tensor(self, values: Any) -> Tensor:
        if not isinstance(values, (Tensor, np.ndarray)):
            raise ActionError(f"the action is {shown(values)}; a tensor or an array is needed")
        rows = torch.as_tensor(values)
        if not rows.is_floating_point():
            raise ActionError(f"the action has dtype {rows.dtype}; it must be floating (float32)")
        return rows.to(self.device, torch.float32, non_blocking=True)

    def _checked_mask(self, mask: Any) -> Tensor:
        if mask is None:
            return ~self._nowhere
        flags = torch.as_tensor(mask) if isinstance(mask, (Tensor, np.ndarray)) else None
        if flags is None or flags.dtype != torch.bool or flags.shape != (self.num_envs,):
            raise TaskError(f"reset_mask must be {self.num_envs} booleans, not {shown(mask)}")
        return flags.to(self.device)


class _NoStreams:
    """Refuses to give a task its random streams, of which there are none for each environment."""

    def __init__(self, task: str) -> None:
        self._task = task

    def __iter__(self) -> Iterator[NoReturn]:
        raise TaskError(
            f"{self._task} asks for each environment's random stream after its episode has begun;"
            " simulator 'mujoco_warp' has none then"
        )


def _checked_device(name: str | torch.device) -> torch.device:
    try:
        device = torch.device(name)
    except (RuntimeError, TypeError) as error:
        raise TaskError(f"device is {shown(name)}; 'cuda:0' or 'cpu' is needed") from error
    if device.type not in ("cuda", "cpu"):
        raise TaskError(f"device is {shown(name)}; 'cuda:0' or 'cpu' is needed")
    if device.type == "cpu":
        return device
    cards = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if (device.index or 0) >= cards:
        raise SimulationError(
            f"device {shown(name)} is not there: torch finds {cards} cards of NVIDIA's;"
            " device='cpu' does the same, slowly"
        )
    return torch.device("cuda", device.index or 0)


def _refuse(scenario: Scenario) -> None:
    """Refuse scenarios that are not for a device."""
    known = (*STATE_FORMS, "none")
    wanted = {
        f"obs_mode={scenario.obs_mode!r} (of {', '.join(known)})": scenario.obs_mode not in known,
        "render_mode": scenario.render_mode is not None,
        **_unvaried(scenario),
        "touch": scenario.touch is not None,
    }
    if refused := [name for name, given in wanted.items() if given]:
        raise TaskError(
            f"simulator 'mujoco_warp' does without {', '.join(refused)}; simulator='mujoco' does"
            " all of it"
        )


def _unvaried(scenario: Scenario) -> dict[str, bool]:
    """Return which axes of a scenario's randomization are declared that do not vary on a device."""
    declared = scenario.randomization.declared if scenario.randomization else ()
    return {f"randomization of {axis}": True for axis in declared if axis not in VARIED}


def _refuse_task(env: TaskEnv) -> None:
    """Refuse tasks that are not for a device."""
    cls = env.task_class
    reasons = {
        "its geometry changes from reset to reset": cls.rebuilds or cls.design is not Task.design,
        "it looks at its environments one by one (begin_step, begin_episodes)": (
            cls.begin_step is not Task.begin_step or cls.begin_episodes is not Task.begin_episodes
        ),
        "its places are fitted to other robots than it is declared for": not env.fit.as_declared,
    }
    if found := [reason for reason, is_so in reasons.items() if is_so]:
        raise TaskError(
            f"{cls.task_id} is not for simulator 'mujoco_warp': {' and '.join(found)};"
            " simulator='mujoco' steps it"
        )


# -- numbers --------------------------------------------------------------------------------------

_STEP, _STRIDE = -0x61C8864680B583EB, 0x2545F4914F6CDD1D  # odd, so that they reach every number
_ROUNDS = ((30, -0x40A7B892E31B1A47), (27, -0x6B2FB644ECCEEE15), (31, 1))  # of SplitMix64
_BITS = 64


def chosen(seeds: Tensor, episodes: Tensor, count: int) -> Tensor:
    """Return one of ``count`` numbers for each seed and number of an episode, (N,) int64 each."""
    mixed = seeds * _STEP + episodes * _STRIDE
    for shift, factor in _ROUNDS:
        kept = (1 << (_BITS - shift)) - 1  # a tensor's shift repeats its sign
        mixed = (mixed ^ ((mixed >> shift) & kept)) * factor
    return (mixed & (2**63 - 1)) % count


def _zeroed(rows: Tensor, where: Tensor) -> Tensor:
    """Return rows, (N, …), with nothing but zeros in some of them."""
    return rows.masked_fill(beside(where, rows), 0)


def _each(tree: Any, change: Callable[[Tensor], Tensor]) -> Any:
    """Return a mapping's tensors, or one alone, each changed."""
    if isinstance(tree, Mapping):
        return {key: _each(part, change) for key, part in tree.items()}
    return change(tree)
