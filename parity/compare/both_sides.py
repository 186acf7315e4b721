"""The two sides of a comparison, native and ours, behind one batched interface."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from parity.compare.native_env import make_native, native_action, native_action_dim, quiet
from parity.compare.snapshot import Snapshot, select, stack, take
from robots import CONTROL_MODES
from simulation.sapien3.contacts import presses_on_object
from tasks import MultiRobotTask

Floats = NDArray[np.float32]


class Side(Protocol):
    """N environments that are reset and stepped together.

    Attributes:
        num_envs: Number of environments N.
        action_dim: Numbers of one flat action A.
    """

    num_envs: int
    action_dim: int

    def reset(self, seeds: Sequence[int], env_ids: Sequence[int], *, rebuild: bool) -> Snapshot:
        """Begin episodes in some environments, with one seed each.

        Args:
            seeds: A seed for each of ``env_ids``.
            env_ids: Which environments.
            rebuild: Whether to build their scenes anew, so that PhysX forgets their past.

        Returns:
            One row for each of ``env_ids``.
        """
        ...

    def step(self, actions: Floats) -> Snapshot:
        """Advance every environment; actions (N, A), one row returned for each environment."""
        ...

    def touching(self) -> NDArray[np.bool_]:
        """Tell where a robot touched a movable object in the last physics step, shape (N,)."""
        ...


class OurSide:
    """A task of this library."""

    def __init__(self, env: MultiRobotTask) -> None:
        """Take a task that was just made."""
        self.env = env
        self.num_envs = env.num_envs
        self.action_dim = env.layout.action_dim

    def reset(self, seeds: Sequence[int], env_ids: Sequence[int], *, rebuild: bool) -> Snapshot:
        """Begin episodes; see `Side`."""
        obs, info = self.env.reset(
            seed=list(seeds), options={"reconfigure": True} if rebuild else None, env_ids=env_ids
        )
        return select(take(self.env, self.num_envs, obs, info), env_ids)

    def step(self, actions: Floats) -> Snapshot:
        """Advance every environment; see `Side`."""
        obs, reward, terminated, _, info = self.env.step(actions)
        return take(self.env, self.num_envs, obs, info, reward, terminated)

    def touching(self) -> NDArray[np.bool_]:
        """Tell where a robot touched a movable object; see `Side`."""
        return self.env.simulation.backend.touching()


class NativeSide:
    """Native environments, one after the other: on the CPU, each holds a single one."""

    def __init__(
        self,
        task_id: str,
        reward_mode: str | None = None,
        num_envs: int = 1,
        control_mode: str = CONTROL_MODES[0],
        *,
        picture_size: int | None = None,
        robot_uid: str | None = None,
    ) -> None:
        """Make the environments; raises what `parity.compare.native_env.make_native` does."""
        self.envs = [
            make_native(
                task_id, reward_mode, control_mode, picture_size=picture_size, robot_uid=robot_uid
            )
            for _ in range(num_envs)
        ]
        self.num_envs = num_envs
        self.action_dim = native_action_dim(self.envs[0])

    def reset(self, seeds: Sequence[int], env_ids: Sequence[int], *, rebuild: bool) -> Snapshot:
        """Begin episodes; see `Side`."""
        rows: list[Snapshot] = []
        with quiet():
            for seed, env in zip(seeds, (self.envs[i] for i in env_ids), strict=True):
                rows.append(take(env, 1, *env.reset(seed=seed, options={"reconfigure": rebuild})))
        return stack(rows)

    def step(self, actions: Floats) -> Snapshot:
        """Advance every environment; see `Side`."""
        return stack(
            [self._step(env, action) for env, action in zip(self.envs, actions, strict=True)]
        )

    def touching(self) -> NDArray[np.bool_]:
        """Tell where a robot touched a movable object; see `Side`."""
        return np.array([presses_on_object(env.scene.px.get_contacts()) for env in self.envs])

    def close(self) -> None:
        """Let the environments go."""
        for env in self.envs:
            env.close()

    @staticmethod
    def _step(env: Any, action: Floats) -> Snapshot:
        obs, reward, terminated, _, info = env.step(native_action(env, action))
        return take(env, 1, obs, info, reward, terminated)
