"""What runs a task: N worlds of one layout with resets, observations, rewards and success."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any, cast

import numpy as np
import torch
from gymnasium.spaces import Box
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray
from torch import Tensor

from robot_layouts.core.processes.start import preload
from robot_layouts.simulation import Simulation, State, World
from robot_layouts.simulation.framed import Fit, FramedState, FramedWorld
from robot_layouts.simulation.maths import Array, Floats, all_finite
from robot_layouts.simulation.world import Part
from robots import SimulationError, TaskError
from tasks.engine import outcome
from tasks.engine.actions import ActionReader
from tasks.engine.cameras import camera_for_people
from tasks.engine.checks import (
    INSTRUCTION,
    ReturnedArrays,
    ReturnedReward,
    check_info,
    checked_ids,
    checked_seeds,
    expect_nothing,
    unchanged,
    wants_rebuild,
)
from tasks.engine.declared import check_declaration
from tasks.engine.display import task_html, task_text
from tasks.engine.divergence import (
    NotFinite,
    SpeedWatch,
    refuse_observation,
    refuse_reward,
    refuse_state,
)
from tasks.engine.observation import Observer, read_mode, space_of
from tasks.engine.outcome import ELAPSED, FAILED, SOLVED
from tasks.engine.pictures import tiled
from tasks.engine.places import built_layout, fitted, is_tested, refuse_collisions
from tasks.engine.remade import Remade
from tasks.engine.scenario import SENSOR_RENDER_MODES, Scenario, Touch, touch_links
from tasks.engine.task import Info, Memory, Task
from tasks.language.bodies import Object
from tasks.language.randomness import EpisodeRandom, phrasings
from tasks.language.stages import PassedStages
from tasks.native.format import StateDict, StateTape, read_state_dict, write_state_dict
from tasks.randomization.distractors import add_distractors, area_of
from tasks.randomization.randomizer import Randomizer

preload(__name__)  # for workers, which step environments


class _FreshScenario:
    """``cls.scenario``: a new scenario at every access, made from the class's own attributes."""

    def __get__(self, instance: object, owner: type[MultiRobotTask]) -> Scenario:
        """Return it; a task that is being run has its own as an attribute."""
        return Scenario(
            layout=owner.layout,
            physics=owner.physics,
            control_frequency=owner.control_frequency,
            randomization=owner.randomization,
        )


class MultiRobotTask(Task):
    """What users subclass to declare a task; see `tasks.engine.task.Task` for what it may have.

    Attributes:
        scenario: A fresh scenario of the class at every access.
    """

    scenario = cast("Scenario", _FreshScenario())

    def __new__(cls, scenario: Scenario, *, first_seed: int | None = None) -> TaskEnv:
        """Return an environment that steps this task; see `TaskEnv`."""
        return TaskEnv(cls, scenario, first_seed=first_seed)


class TaskEnv(Remade):
    """Environments of a task, which are stepped together: what `tasks.make` returns.

    Whatever the task declares is found here as well (``env.task_id``, ``env.bodies``): an attribute
    that this class has not is that of ``env.task``.

    Attributes:
        task: The task, an instance of the class that a user declared.
        scenario: What it was made from.
        layout: Which robots stand where, in their control mode.
        control_mode: Control mode of all robots, or those by arm.
        num_envs: Number of environments N.
        single_action_space: Action of one environment, (A,); joint limits (rad) where the control
            mode asks for positions, else [-1, 1].
        action_space: Actions of all environments, (N, A).
        action_split: Robot name → slice of the flat action, in declared order.
        observer: What puts its observations together, and its cameras.
        observation_slices: Where each named part stands in the flat observation.
        state_was_set: Whether `set_state_dict` was called since all worlds were last built anew:
            what happens then does not follow from seeds and actions alone.
        start: Observation and info of the first reset, when it was made.
    """

    state_was_set: bool = False

    # -- making and closing ------------------------------------------------------------------

    def __init__(
        self,
        task_class: type[MultiRobotTask],
        scenario: Scenario,
        *,
        first_seed: int | None = None,
    ) -> None:
        """Build the worlds and begin episodes with the class's first seeds.

        Args:
            task_class: The task.
            scenario: How to make it; `tasks.make` and ``cls.scenario`` give one to start from.
            first_seed: Environment i starts with seed ``first_seed + i``; None takes the class's.

        Raises:
            TaskError: If the scenario asks for what the task does not offer.
            SimulationError: If a control step is no whole number of physics steps.
            LayoutError: If the robots of the layout collide.
            AssetError: If robot files cannot be found.
        """
        check_declaration(task_class)
        scenario.check(task_class.reward_modes)
        layout = built_layout(task_class, scenario)
        if scenario.check_layout and not is_tested(task_class, scenario.layout):
            refuse_collisions(scenario.layout, task_class.table.outline(scenario.layout))
        self.task = task = object.__new__(task_class)
        self.scenario = task.scenario = scenario
        self.layout = task.layout = layout
        if task_class.fits():
            vars(task).update(fitted(task_class, layout))
        self._fit = None if task.fit.as_declared else task.fit
        mode = scenario.layout.control_mode(scenario.control_mode)
        self.control_mode = task.control_mode = mode
        self.num_envs = task.num_envs = scenario.num_envs
        self.obs_mode = scenario.obs_mode
        self.reward_mode = scenario.reward_mode or task.reward_modes[0]
        if scenario.max_episode_steps is not None:
            task.max_episode_steps = scenario.max_episode_steps
        self.action_split = self.layout.action_split
        low, high = np.array(self.layout.action_bounds, np.float32).T
        rows = self.num_envs, 1
        self.single_action_space = Box(low, high, dtype=np.float32)
        self.action_space = Box(np.tile(low, rows), np.tile(high, rows), dtype=np.float32)
        self._reader = ActionReader(self.layout, self.num_envs)
        observed = read_mode(scenario.obs_mode)
        self._touch = Touch(touch_links(layout, scenario.touch))
        self._feels = bool(self._touch.names)
        cameras = scenario.cameras or task.cameras
        size = scenario.camera_size
        self.observer = Observer(
            layout,
            observed,
            cameras,
            (*task.sensed, *self._touch.names),
            task.viewpoint,
            size,
            configs=scenario.sensor_configs,
            shown=scenario.render_mode in SENSOR_RENDER_MODES,
        )
        self._for_people = camera_for_people(
            task.viewpoint, scenario.human_render_camera_configs or {}
        )
        first = task.first_seed if first_seed is None else first_seed
        self._rngs = [EpisodeRandom(first + i) for i in range(self.num_envs)]
        kept = np.float64 if task.double_rewards else np.float32
        self._max_reward = np.array(task.max_reward, kept)
        self._elapsed = np.zeros(self.num_envs, np.int32)
        self._everywhere: Sequence[int] = range(self.num_envs)
        task.moving = self._everywhere
        task.memory = Memory()
        self._expect_returns(task_class.__name__)
        self._randomizer: Randomizer | None = None
        vars(task).update(
            _rngs=self._rngs,
            _chosen_phrasings=partial(phrasings, self._rngs),
            _elapsed=self._elapsed,
            _randomizer=None,
        )
        self._simulation: Simulation | None = Simulation(
            self.layout,
            self._build_world,
            self.num_envs,
            scenario.physics,
            control_frequency=scenario.control_frequency,
            visuals=scenario.draws,
            shadows=scenario.enable_shadow,
            links_pass=task.native_id is not None,
            simulator=scenario.simulator,
        )
        task.simulation = self._simulation
        self._speeds = SpeedWatch(self._simulation)
        self._progress = PassedStages(task.stages, self.num_envs) if task.stages else None
        self._phrasings = np.array(task.instruction if isinstance(task.instruction, tuple) else ())
        self._tells = self._progress is not None or len(self._phrasings) > 0
        if scenario.randomization:
            self._randomizer = Randomizer(
                scenario.randomization,
                self._simulation,
                scenario.cameras or task.cameras,
                area_of(task.table.outline(layout), task.viewpoint[1]),
            )
            vars(task)["_randomizer"] = self._randomizer
            self._draw(self._everywhere)
            if self._randomizer.rebuilds:
                self._simulation.rebuild(self._everywhere, self._build_again)
        self._camera: Any = None
        self._responds = task_class.respond is not Task.respond
        self._begins_steps = task_class.begin_step is not Task.begin_step
        self.start = self._begin(list(range(self.num_envs)), reconfigured=True)
        self._describe_observation()

    def __repr__(self) -> str:
        """Show what it is and what was made of it, in a few lines."""
        made = "observation_slices" in vars(self)
        return task_text(self) if made else object.__repr__(self)

    def _repr_html_(self) -> str:
        """Show a notebook the same, with the layout's picture."""
        return task_html(self)

    def __getattr__(self, name: str) -> Any:
        """Return what the task has under a name that the environments do not use themselves."""
        if name.startswith("__") or "task" not in vars(self):
            raise AttributeError(name)
        return getattr(self.task, name)

    @property
    def task_class(self) -> type[MultiRobotTask]:
        """The class that a user declared."""
        return type(self.task)

    @property
    def seeds(self) -> list[int]:
        """What the random streams of each environment last began with."""
        return [rng.seed for rng in self._rngs]

    @property
    def simulation(self) -> Simulation:
        """The worlds.

        Raises:
            SimulationError: If the task was closed.
        """
        if self._simulation is None:
            raise SimulationError(f"this {self.task_class.__name__} is closed; make a new one")
        return self._simulation

    @property
    def state(self) -> State:
        """What all worlds look like now, as `evaluate` is given it; read anew after each step.

        Raises:
            SimulationError: If the task was closed.
        """
        return self.simulation.read()

    @property
    def segmentation_id_map(self) -> dict[int, Part]:
        """What the numbers of a segmentation stand for: ``part.name``, of ``part.robot`` or None.

        The numbers are native's, and the names of links and bodies, too.
        """
        return self.simulation.backend.segments()

    def close(self) -> None:
        """Let the worlds go; closing twice is allowed."""
        self._simulation = None
        vars(self.task).pop("simulation", None)
        self._camera = None
        for holder in ("_state", "_speeds"):  # of the worlds as well
            vars(self).pop(holder, None)
        self.observer.close()

    # -- episodes ----------------------------------------------------------------------------

    def reset(
        self,
        seed: int | Sequence[int | None] | None = None,
        options: Mapping[str, Any] | None = None,
        env_ids: Sequence[int] | None = None,
    ) -> tuple[Any, Info]:
        """Begin new episodes.

        Args:
            seed: ``k`` seeds environment i with k + i; a list gives each of ``env_ids`` its own;
                None, also in a list, lets the random streams run on.
            options: ``{"reconfigure": True}`` rebuilds the worlds, so that nothing of their
                past is left in PhysX.
            env_ids: Which environments; all if None. The others go on as they are.

        Returns:
            Observation and info of all environments.

        Raises:
            TaskError: If an argument is invalid; nothing is reset then.
        """
        ids = checked_ids(env_ids, self.num_envs)
        seeds = checked_seeds(seed, ids)
        reconfigure = wants_rebuild(options) or self.task.rebuilds
        self.simulation.touched()
        for i, own_seed in zip(ids, seeds, strict=True):
            if own_seed is not None:
                self._rngs[i].restart(own_seed)
                continue
            self._rngs[i].resets += 1
            if reconfigure:
                self._rngs[i].reseed_for_rebuild()
        self._draw(ids)
        again = self._randomizer is not None and self._randomizer.rebuilds
        if reconfigure:
            self.simulation.rebuild(ids, self._build_world)
            self.state_was_set &= len(ids) < self.num_envs
        elif again:
            self.simulation.rebuild(ids, self._build_again)
        return self._begin(ids, reconfigured=reconfigure or again)

    def step(
        self, action: Any, env_ids: Sequence[int] | None = None
    ) -> tuple[Any, Tensor, Tensor, Tensor, Info]:
        """Advance environments by one control step.

        There is no automatic reset, and stepping past truncation is allowed.

        Args:
            action: (N, A) tensor or array in the order of ``action_split``, or a mapping
                robot name → (N, a); normalised numbers beyond [-1, 1] are clipped, joint
                positions beyond their limits are not.
            env_ids: Which environments move; all if None. The others stand still, and what is
                returned for them means nothing.

        Returns:
            Observation, reward (N,) float32, terminated (N,), truncated (N,), info. An
            environment terminates when it succeeds or fails. See `Task.double_rewards`.

        Raises:
            ActionError: If the action has a wrong shape, type or number; nothing moves then.
            DivergedError: If physics diverged: a pose is not finite, or a joint moves at a
                hundred times its largest speed. At ten times a `RuntimeWarning` says so.
            TaskError: If the task's reward or observation is not finite.
        """
        obs, reward, terminated, truncated, info = self.advance(action, env_ids)
        observed = _tensor(obs) if isinstance(obs, np.ndarray) else _tensors(obs)
        details = (
            _tensors(info)
            if self._tells
            else dict(zip(info, map(_tensor, info.values()), strict=True))
        )
        return observed, _tensor(reward), _tensor(terminated), _tensor(truncated), details

    def advance(
        self, action: Any, env_ids: Sequence[int] | None = None
    ) -> tuple[Any, Floats, NDArray[np.bool_], NDArray[np.bool_], Info]:
        """Do what `step` does, and return NumPy arrays where it returns tensors."""
        flat, simulation = self._reader.read(action), self.simulation
        ids = None if env_ids is None else checked_ids(env_ids, self.num_envs)
        moving = self.task.moving = self._everywhere if ids is None else ids
        if self._begins_steps:
            self.task.begin_step()
        if self._randomizer is None:
            simulation.step(flat, self._state.joint_positions, ids)
        else:
            before = self._state.joint_positions
            self._randomizer.step(simulation, flat, before, moving, self._elapsed)
        if ids is None:
            self._elapsed += _ONE
        else:
            self._elapsed[ids] += 1
        state = self._read()
        self._speeds.look(state, moving, self._elapsed)
        if self._responds:
            expect_nothing(self.task, "respond", self.task.respond(state))
            self.simulation.touched()
            state = self._read()
        info = self._info(state)
        self.observer.changed(moving)
        obs = self._observation(state, info, moving)
        reward = self._reward(state, flat, info)
        truncated = self._elapsed >= self.task.max_episode_steps
        ended = info[SOLVED].copy() if self._only_succeeds else outcome.ended(info)
        return obs, reward, ended, truncated, info

    def trust(self, actions: Floats) -> None:
        """Take what is in this very array, (N, A), as actions that were checked before."""
        self._reader.checked = actions

    def get_state_dict(self) -> StateDict:
        """Return all poses and velocities under native's keys; see `native_format`."""
        return read_state_dict(self.simulation, self._state)

    def to_mjcf(self, path: str | PathLike[str]) -> Path:
        """Save the first environment as one MJCF model for MuJoCo, as it stands.

        It has the robots as `layouts.Layout.to_mjcf` describes them, the task's bodies under their
        names, with what they weigh and how they rub, and a keyframe ``now`` with the present state
        and drives that hold the robots in it. Bodies that nothing moves, or only the task, are
        ``mocap`` bodies. Meshes of robots are in a folder ``NAME_assets``, those of bodies in the
        file; MuJoCo writes numbers of six digits. What varies in each episode beyond sizes and
        places, such as friction, is as declared.

        Args:
            path: Where to save; must end in ``.xml``. The folder beside it is replaced if it
                exists.

        Returns:
            The path of the model.

        Raises:
            LayoutError: If the path ends otherwise, or the folder holds something else.
            AssetError: If a file of a robot or a body cannot be found or is invalid.
            SimulationError: If MuJoCo cannot do what the task's physics settings ask for.
            MissingPackageError: If mujoco is not installed.
        """
        return self._export("mjcf", path)

    def to_usd(self, path: str | PathLike[str]) -> Path:
        """Save the first environment as one USD stage, as it stands.

        It has the robots as `layouts.Layout.to_usd` describes them, where they are now, and below
        ``bodies`` the task's bodies: rigid bodies with density and friction, articulations of
        those with joints, kinematic ones of those that only the task moves, and colliders alone of
        those that nothing moves. Display names are the task's. What is there for people only is a
        guide. Textures become their mean colour; what varies in each episode beyond sizes and
        places is as declared.

        Args:
            path: Where to save; must end in ``.usd``, ``.usda`` or ``.usdc``.

        Returns:
            The path of the stage.

        Raises:
            LayoutError: If the path ends otherwise.
            AssetError: If a file of a robot or a body cannot be found or is invalid.
            MissingPackageError: If usd-core or scipy is not installed.
        """
        return self._export("usd", path)

    def to_ros2(self, folder: str | PathLike[str]) -> Path:
        """Save the first environment as a ROS 2 package for MoveIt and ros2_control, as it stands.

        It is the package of `layouts.Layout.to_ros2`, with robots at home where they are now.
        Bodies that nothing moves are links of its URDF. Those that move are objects of MoveIt's
        planning scene, ``config/bodies.scene``, which the launch file publishes, and each has a
        URDF of its own in ``urdf/bodies`` for simulators; ``config/bodies.yaml`` says where it is
        (m, xyzw), whether something holds it there, and where its joints are and their springs,
        which no URDF has. Planes are slabs of 100 m.

        Args:
            folder: See `layouts.Layout.to_ros2`.

        Returns:
            The folder.

        Raises:
            LayoutError: If the folder's name is no valid package name, or it holds something else.
            AssetError: If a file of a robot or a body cannot be found or is invalid.
            MissingPackageError: If scipy is not installed.
        """
        return self._export("ros2", folder)

    def _export(self, written_as: str, path: str | PathLike[str]) -> Path:
        things = [own.descriptor for own in self.task.bodies.values() if isinstance(own, Object)]
        return self.simulation.export(written_as, self._state, path, things)

    def begin_tape(self) -> StateTape:
        """Return a tape of states for the present episode; see `write_tape`."""
        return StateTape(self.simulation)

    def write_tape(self, tape: StateTape) -> None:
        """Add the present state to a tape: what `get_state_dict` returns, much cheaper."""
        tape.write(self._state)

    def set_state_dict(
        self, state: Mapping[str, Mapping[str, Any]], env_ids: Sequence[int] | None = None
    ) -> None:
        """Put environments into a state, row by row.

        Args:
            state: What `get_state_dict` returns, with one row per environment set.
            env_ids: Which environments; all if None.

        Raises:
            TaskError: If a key, a shape or a number is wrong, see `native_format`; nothing is
                changed then.
        """
        ids = checked_ids(env_ids, self.num_envs)
        write_state_dict(self.simulation, state, ids)
        self.state_was_set = True
        self.observer.changed(ids)
        self._read()

    def flat_state(self) -> Floats:
        """Return what ``obs_mode="state"`` observes, (N, D), whatever the task's own mode is."""
        state = self._state
        parts = self.task.observe(state, self._info(state))
        if self._feels:
            parts = self._with_touch(parts, state)
        observer = Observer(self.layout, read_mode("state"), (), (), self.task.viewpoint)
        return observer.observe(self.simulation, state, parts)

    def render(self) -> np.ndarray:
        """Return a picture of every environment, (N, H, W, 3) uint8.

        With ``render_mode="rgb_array"`` it is one for people, 512 pixels wide and high unless
        ``human_render_camera_configs`` say otherwise; with ``"sensors"`` what each camera sees, in
        colours, side by side; with ``"all"`` both.

        Raises:
            TaskError: If the task was made without a ``render_mode``.
        """
        mode, pictures = self.scenario.render_mode, list[NDArray[np.uint8]]()
        if mode is None:
            raise TaskError("this task draws no pictures; make it with render_mode='rgb_array'")
        if mode != "sensors":
            if self._camera is None:
                from robot_layouts.simulation.rendering import Cameras

                view = self._for_people
                self._camera = Cameras(self.simulation, *self.task.viewpoint, camera=view)
            pictures.append(self._camera.take())
        if mode in SENSOR_RENDER_MODES:
            pictures += self.observer.pictures(self.simulation)
        return tiled(pictures)

    # -- inside ------------------------------------------------------------------------------

    def _expect_returns(self, name: str) -> None:
        """Say what the methods of the class must return."""
        count = self.num_envs
        open_ended = self.task.open_ended
        self._judged = ReturnedArrays(
            f"{name}.evaluate()", count, judges=True, open_ended=open_ended
        )
        self._observed = ReturnedArrays(f"{name}.observe()", count, axes=2)
        self._remembered = ReturnedArrays(f"{name}.remember()", count)
        double = self.task.double_rewards
        self._rewards = ReturnedReward(f"{name}.dense_reward()", count, double=double)

    def _build_world(self, world: World, index: int) -> None:
        rng = self._rngs[index]
        world.design = self.task.design(rng)
        if self._randomizer is not None:
            self._randomizer.describe(world, index)
        self._fill(world)
        rng.restart_numpy()

    def _build_again(self, world: World, index: int) -> None:
        """Build the same world with what varies, which leaves the task's draws as they are."""
        assert self._randomizer is not None
        world.design = self.simulation.worlds[index].design
        self._randomizer.describe(world, index)
        self._fill(world)

    def _framed(self, world: World) -> World:
        """Return a world as the task declares what is in it."""
        return world if self._fit is None else FramedWorld(world, self._fit)

    def _declared(self, state: State, fit: Fit) -> State:
        """Return a state as the task declares what is in it."""
        if (seen := state.memo.get(FramedState)) is None:
            bodies = self.simulation.worlds[0].bodies
            seen = state.memo[FramedState] = FramedState(state, fit, bodies)
        return seen

    def _fill(self, world: World) -> None:
        expect_nothing(self.task, "build", self.task.build(self._framed(world)))
        if (varied := self.scenario.randomization) and varied.distractors:
            add_distractors(world, varied.distractors)

    def _draw(self, ids: Iterable[int]) -> None:
        """Draw what varies in the coming episodes."""
        if self._randomizer is not None:
            for i in ids:
                self._randomizer.begin(i, self._rngs[i].stream)
                self._rngs[i].spread = self._randomizer.spread(i)

    def _begin(self, ids: list[int], *, reconfigured: bool) -> tuple[Any, Info]:
        task = self.task
        self.simulation.clear(ids)
        if self._randomizer is not None:
            self._randomizer.apply(self.simulation, ids)
        for i in ids:  # all that is placed here reaches the simulator in one go
            world = self.simulation.worlds[i]
            expect_nothing(task, "reset_robots", task.reset_robots(world, self._rngs[i]))
            expect_nothing(task, "sample", task.sample(self._framed(world), self._rngs[i]))
        if reconfigured:
            self._camera = None
        self._elapsed[ids] = 0
        if self._progress is not None:
            self._progress.begin(ids)
        self._speeds.begin(ids)
        state = self._read()
        if self._randomizer is not None and self._randomizer.scatter(self.simulation, state, ids):
            state = self._read()
        self.simulation.hold(state)
        if self._randomizer is not None:
            self._randomizer.rest(self.simulation, state, ids)
        own = state if self._fit is None else self._declared(state, self._fit)
        task.memory.renew(self._remembered.checked(task.remember(own)), ids)
        expect_nothing(task, "begin_episodes", task.begin_episodes(state, ids))
        info = self._info(state)
        check_info(self.task_class.__name__, info)
        self.observer.changed(ids)
        obs = self._observation(state, info, ids)
        if self._randomizer is not None:
            info |= self._randomizer.info()
        return _tensors(obs), {**_tensors(info), "reconfigure": reconfigured}

    def _describe_observation(self) -> None:
        """Read spaces and slices off the first observation."""
        state, mode, name = self._read(), self.observer.mode, self.task_class.__name__
        with unchanged(state, f"{name}.evaluate()"):
            info = self._info(state)
        self._only_succeeds = SOLVED in info and FAILED not in info  # as nearly all tasks
        with unchanged(state, f"{name}.observe()"):
            parts = {} if mode.nothing else self._observed.checked(self.task.observe(state, info))
        if self._feels and not mode.nothing:
            parts = self._with_touch(parts, state)
        self.observation_slices = self.observer.slices(self.simulation, state, parts)
        self.single_observation_space = space_of(self.start[0], batched=True)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def _read(self) -> State:
        state = self.simulation.read()
        if not all_finite(state.all_poses):
            before = vars(self).get("_state")
            self._state = state
            refuse_state(state, before, self._speeds, self._elapsed)
        self._state = state
        return state

    def _info(self, state: State) -> Info:
        own = state if self._fit is None else self._declared(state, self._fit)
        judged = self._judged.checked(self.task.evaluate(own))
        info: Info = {ELAPSED: self._elapsed.copy(), **judged}
        if (modes := self.simulation.modes) is not None:
            info |= {f"{arm}.shortfall": rows.copy() for arm, rows in modes.shortfalls.items()}
        return self._told(info) if self._tells else info

    def _told(self, info: Info) -> Info:
        """Return info with how far the episodes have come, and what is to be done in them."""
        if self._progress is not None:
            info |= self._progress.told(info)
        if len(self._phrasings):
            info[INSTRUCTION] = self._phrasings[phrasings(self._rngs, len(self._phrasings))]
        return info

    def _with_touch(self, parts: Mapping[str, Array], state: State) -> dict[str, Array]:
        """Return the parts that the task observes, and after them what links feel."""
        return {**parts, **self._touch.read(state, self._elapsed)}

    def _observation(self, state: State, info: Info, ids: Sequence[int]) -> Any:
        """Return what is observed of all environments, of which those in ``ids`` have moved."""
        mode = self.observer.mode
        if mode.nothing:
            return {}
        parts = {} if mode.columns else self._observed.checked(self.task.observe(state, info))
        if self._feels:
            parts = self._with_touch(parts, state)
        randomizer = self._randomizer
        try:
            if randomizer is None:
                return self.observer.observe(self.simulation, state, parts)
            noisy = randomizer.sensors(lambda: self.observer.names(parts), self._elapsed)
            return randomizer.seen(self.observer.observe(self.simulation, state, parts, noisy), ids)
        except NotFinite:
            refuse_observation(state, parts, self.task, self._speeds, self._elapsed)

    def _reward(self, state: State, action: Floats, info: Info) -> Floats:
        match self.reward_mode:
            case "normalized_dense":
                return self._dense(state, action, info) / self._max_reward
            case "dense":
                return self._dense(state, action, info)
            case "sparse":
                return outcome.sparse(info).astype(np.float32)
            case _:
                return np.zeros(self.num_envs, np.float32)

    def _dense(self, state: State, action: Floats, info: Info) -> Floats:
        own = state if self._fit is None else self._declared(state, self._fit)
        if self._rewards.dtype is None:  # the first
            with unchanged(state, f"{self.task_class.__name__}.dense_reward()"):
                reward = self._rewards.checked(self.task.dense_reward(own, action, info))
        else:
            reward = self._rewards.checked(self.task.dense_reward(own, action, info))
        if not all_finite(reward):
            refuse_reward(reward, self.task, self._elapsed)
        return reward


_tensor = torch.from_numpy
_ONE = np.array(1, np.int32)  # which NumPy adds in a third of the time that 1 takes


def _tensors(tree: Any) -> Any:
    """Return arrays, or mappings of them, as users get them: tensors that share their memory."""
    if isinstance(tree, dict):
        return {key: _tensors(value) for key, value in tree.items()}
    return tree if tree.dtype.kind == "U" else _tensor(tree)  # texts stay an array
