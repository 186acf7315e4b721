"""What a user declares: a task, which knows nothing of what steps it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from layouts import Layout
from robot_layouts.simulation import Camera, PhysicsSettings, Simulation, State, World
from robot_layouts.simulation.maths import Array, Floats, copy
from robots import UnknownNameError
from tasks.engine.scenario import Scenario
from tasks.language.bodies import Body, Declared, Surroundings, Table, declared_bodies
from tasks.language.fitting import AS_DECLARED, Fit
from tasks.language.needs import Needs
from tasks.language.randomness import EpisodeRandom
from tasks.randomization.declaration import SETTINGS, Randomization
from tasks.randomization.distributions import Distribution, Normal
from tasks.randomization.noise import noise
from tasks.randomization.randomizer import Randomizer

Info = dict[str, Any]

DENSE_MODES = ("normalized_dense", "dense", "sparse", "none")
SPARSE_MODES = ("sparse", "none")
_NORMAL = Normal(1.0)
_FIXED: Mapping[str, Any] = {"spread": 0.0}


class Memory(SimpleNamespace):
    """Arrays by name, (N, …) each, as attributes."""

    def __getattr__(self, name: str) -> Any:
        """Refuse what is not there.

        Raises:
            NotRememberedError: Always.
        """
        if name.startswith("__"):
            raise AttributeError(name)
        raise NotRememberedError("array that remember() returned", name, vars(self))

    def renew(self, fresh: Mapping[str, Array], env_ids: Sequence[int]) -> None:
        """Take the rows of environments that were reset; the others stay.

        Args:
            fresh: Every array, with all rows; those of ``env_ids`` are taken.
            env_ids: Which environments.
        """
        for name, rows in fresh.items():
            if name not in vars(self) or len(env_ids) == len(rows):
                setattr(self, name, copy(rows))
            else:
                kept = copy(getattr(self, name))  # the task may still hold the earlier one
                kept[list(env_ids)] = rows[list(env_ids)]
                setattr(self, name, kept)


class NotRememberedError(UnknownNameError, AttributeError):
    """An array that the task does not remember (also an ``AttributeError``)."""


class Task:
    """Something to achieve, for one robot or many; users subclass `tasks.MultiRobotTask`.

    A class sets ``layout`` and ``max_episode_steps``, declares its bodies as class attributes
    (`tasks.language.bodies`), and defines success in `evaluate`. It may define `observe` and
    `dense_reward` as well, and override `build` and `sample`, which add and place the declared
    bodies.

    `tasks.make`, and calling the class with a scenario, return a `TaskEnv`, which steps it: that
    holds one instance of the class, whose methods it calls. Beside what the class declares, they
    find there what the environments are made with.

    Attributes:
        task_id: The task's id.
        native_id: Id of the ManiSkill task that it clones; None for a task of our own.
        source: Where its numbers come from; of a clone package, version and file.
        layout: Default layout; in methods, that of the environments.
        table: What the robots stand at, the first of its bodies: a `tasks.Table`, or another
            `tasks.Surroundings`, such as the bare `tasks.Ground`.
        bodies: The bodies that its class declares, by name, in the order declared; see
            `tasks.language.bodies`.
        robot_counts: How many robots a layout may have, in places of any names; None if it takes
            exactly the places of ``layout``.
        needs: What places need of their robots, by place, ``"*"`` for all others; see
            `tasks.Needs`.
        fits_robots: Whether its places and sizes fit the robots that it is made with; they are
            declared in numbers for those of ``layout``. `build` and `sample` are then given worlds,
            and `evaluate`, `dense_reward` and `remember` states, in the frame and the lengths of
            the declaration; `observe` and all others see the world as it is. A task over any number
            of robots goes by its layout instead.
        fit: In methods, how they do: `tasks.Fit`.
        physics: Solver settings; None keeps SAPIEN's own defaults.
        control_frequency: Control steps per second, unless a scenario says otherwise (Hz).
        randomization: What varies from episode to episode; None for nothing.
        max_episode_steps: Control steps until an episode is truncated.
        open_ended: Whether nothing counts as success, so that `evaluate` returns none.
        reward_modes: Reward modes, the default first; ``sparse`` is left out if it is open-ended.
        max_reward: What ``normalized_dense`` divides the dense reward by.
        double_rewards: Whether dense rewards are float64, as in some of ManiSkill's tasks.
        first_seed: Environment i starts with seed ``first_seed + i`` when it is made.
        rebuilds: Whether every reset builds the worlds anew, with a new `design`.
        viewpoint: Camera position and target of `render` (m, world).
        cameras: Cameras that observe, where images are asked for; those of the robots come after.
        instruction: What is to be done, in a sentence, for robots that are told so; the beginning
            of the class's docstring if empty. Of several, seed ``k`` tells the one numbered ``k``
            modulo their number; info has it as ``instruction``.
        stages: How far an episode has come: names of flags that `evaluate` returns, in the order in
            which they are passed, and the score that each is worth, rising to ``"success": 1.0``.
            Info has the number of those passed, the name and the score of the last one. They belong
            to the episode, as its elapsed steps do; none if empty.
        varied: What the setting ``randomization="varied"`` varies, by axis, as
            `tasks.Randomization` takes it; see `setting`.
        sensed: Which parts of `observe` a real robot knows, so that they are observed beside
            images; the others are privileged. ``*`` stands for any letters.
        scenario: A fresh scenario of the class at every access; in methods, the one that the
            environments are made with.
        num_envs: Number of environments N.
        control_mode: Control mode of all robots, or those by arm.
        simulation: The worlds.
        moving: Which environments the present step advances.
        memory: What `remember` returned, as attributes.
    """

    scenario: Scenario
    num_envs: int
    control_mode: str | dict[str, str]
    simulation: Simulation
    moving: Sequence[int]
    memory: Memory
    _randomizer: Randomizer | None
    _rngs: Sequence[EpisodeRandom]
    _chosen_phrasings: Callable[[int], Any]
    _elapsed: NDArray[np.int32]

    task_id: ClassVar[str] = ""
    native_id: ClassVar[str | None] = None
    source: ClassVar[str] = ""
    layout: Layout
    table: ClassVar[Surroundings] = Table()
    bodies: ClassVar[Mapping[str, Declared]] = {}
    robot_counts: ClassVar[range | None] = None
    needs: ClassVar[Mapping[str, Needs]] = {}
    fits_robots: ClassVar[bool] = False
    fit: Fit = AS_DECLARED
    physics: ClassVar[PhysicsSettings | None] = None
    control_frequency: ClassVar[float] = 20.0
    randomization: ClassVar[Randomization | None] = None
    max_episode_steps: int
    open_ended: ClassVar[bool] = False
    reward_modes: ClassVar[tuple[str, ...]] = ()
    max_reward: ClassVar[float] = 1.0
    double_rewards: ClassVar[bool] = False
    first_seed: ClassVar[int] = 0
    rebuilds: ClassVar[bool] = False
    viewpoint: ClassVar[tuple[tuple[float, float, float], tuple[float, float, float]]] = (
        (0.6, 0.7, 0.6),
        (0.0, 0.0, 0.35),
    )
    cameras: ClassVar[tuple[Camera, ...]] = (Camera((0.3, 0.0, 0.6), (-0.1, 0.0, 0.1)),)
    instruction: ClassVar[str | tuple[str, ...]] = ""
    stages: ClassVar[Mapping[str, float]] = {}
    varied: ClassVar[Mapping[str, Any]] = {}
    sensed: ClassVar[tuple[str, ...]] = ("*tcp_pose",)

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """Collect the declared bodies; offer dense modes if there is a dense reward."""
        super().__init_subclass__(**kwargs)
        cls.bodies = declared_bodies(cls)
        if "reward_modes" not in cls.__dict__:
            dense = cls.dense_reward is not Task.dense_reward
            modes = DENSE_MODES if dense else SPARSE_MODES
            cls.reward_modes = tuple(m for m in modes if not cls.open_ended or m != "sparse")

    @classmethod
    def fits(cls) -> bool:
        """Return whether it fits its robots: it says so, and has places of its own to go by."""
        return cls.fits_robots and cls.robot_counts is None

    @classmethod
    def setting(cls, name: str) -> Randomization | None:
        """Return what varies in a setting of the task, by how hard that makes it.

        Args:
            name: ``"fixed"``: nothing, every body begins in the middle of its area; ``"spread"``:
                only what the task itself draws; ``"varied"``: what the class declares as well.

        Raises:
            UnknownNameError: If there is no such setting.
        """
        known = SETTINGS if cls.varied else SETTINGS[:2]
        if name not in known:
            raise UnknownNameError(f"setting of {cls.__name__}", name, known)
        axes = (_FIXED, {}, cls.varied)[known.index(name)]
        return Randomization(**axes) if axes else None

    def design(self, rng: EpisodeRandom) -> Any:
        """Draw the geometry of one environment; `build` finds it as ``world.design``."""
        return None

    def build(self, world: World) -> None:
        """Add the task's bodies to a world, in the order declared; the robots stand already."""
        for name, body in self.bodies.items():
            body.add_to(world if isinstance(body, Body) else world.whole, name)

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Place the task's bodies for a new episode; the robots are placed already."""
        for name, body in self.bodies.items():
            if isinstance(body, Body):
                body.place(world, name, rng)

    def evaluate(self, state: State) -> dict[str, Array]:
        """Return ``success`` (N,) bool and whatever else describes the state.

        ``fail`` (N,) bool says where an episode is lost: it ends there, as it does with success,
        and the sparse reward is -1. An `open_ended` task leaves ``success`` out.

        Arrays, as the state gives them: they reach the user as tensors.
        """
        raise NotImplementedError

    def observe(self, state: State, info: Info) -> dict[str, Array]:
        """Return named parts of the observation, each (N, k) or (N,), after the robots' own."""
        return {}

    def dense_reward(self, state: State, action: Floats, info: Info) -> Floats:
        """Return the dense reward, (N,)."""
        raise NotImplementedError

    def remember(self, state: State) -> Mapping[str, Array]:
        """Return what later steps look back at, by name, each (N, …), as it is after a reset.

        The task finds it as an attribute of `memory` and may change it there; the rows of
        environments that are reset are taken anew.
        """
        return {}

    def begin_episodes(self, state: State, env_ids: Sequence[int]) -> None:
        """Do what a new episode needs besides; called after ``env_ids`` were reset."""

    def begin_step(self) -> None:
        """Refuse a control step that cannot be taken, by raising an error; nothing has moved yet.

        Only the environments in ``moving`` take the step.
        """

    def respond(self, state: State) -> None:
        """Move bodies in answer to a control step, before the step is judged.

        Called after every step's physics if a subclass has it; the state is read anew then.
        Only the environments in ``moving`` take the step.
        """

    def reset_robots(self, world: World, rng: EpisodeRandom) -> None:
        """Stand every robot at its placement, with joint noise."""
        for name, off in rng.joint_noise(world.layout).items():
            self.stand(world, name, off)

    def stand(self, world: World, robot: str, noise: NDArray[Any]) -> None:
        """Stand a robot at its placement, off its keyframe by ``noise``, (dof,) (rad, m).

        Groups without reset noise stay exact. The sum is taken in the type of ``noise``.
        """
        placement = world.layout[robot]
        groups = placement.robot.action_split.groups.values()
        noisy = [group.reset_noise for group in groups for _ in group.joints]
        qpos = np.array(placement.start_qpos, noise.dtype)
        world.stand(robot, np.where(noisy, noise + qpos, qpos))

    def drawn(self, env: int = 0) -> dict[str, Any] | None:
        """Return what was drawn for an environment's episode, by axis and name, as plain data.

        Args:
            env: The number of the environment.

        Returns:
            Such as ``{"mass": {"cube": 1.31}}``; see `tasks.Randomization`. None if nothing varies.
        """
        return None if self._randomizer is None else self._randomizer.drawn(env)

    def standing(self, env: int = 0) -> Layout:
        """Return the layout as robots stand in the present episode of an environment.

        It is ``layout``, unless the bases of robots vary. What is planned is planned in this one.
        """
        return self.layout if self._randomizer is None else self._randomizer.layout(env)

    def scale(self, body: str) -> Floats:
        """Return the factor by which a body is larger than declared, (N,); 1 if sizes are fixed."""
        if self._randomizer is None:
            return np.ones(self.num_envs, np.float32)
        return self._randomizer.scale(body)

    def noise(self, name: str, width: int, drawn: Distribution = _NORMAL) -> Floats:
        """Return noise for `observe`, a function of each episode's seed and step alone.

        Args:
            name: What it is for; another name draws other numbers.
            width: How many numbers each environment gets.
            drawn: What each is drawn from; if not given, of mean 0 and deviation 1.

        Returns:
            Shape (N, width).
        """
        streams = [rng.stream for rng in self._rngs]
        return noise(streams, self._elapsed.tolist(), drawn, width, "observe", name)
