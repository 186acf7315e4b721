"""What Gymnasium's registry holds of a task, and under which name."""

from __future__ import annotations

from gymnasium.envs.registration import EnvSpec

from tasks.registry import get_task_class

NAMESPACE = "RobotLayouts"  # Gymnasium ids are RobotLayouts/PickCube-v1


class TaskSpec(EnvSpec):
    """An entry of Gymnasium's registry that knows how long a task's episodes are.

    It asks the task's class, and only when it is asked itself: importing `tasks` loads no task.
    """

    def _steps(self) -> int:
        """Return what was set, or given to `gymnasium.make_vec`, or the task's own."""
        known = self._set_steps or self.kwargs.get("max_episode_steps")
        return known or get_task_class(self.id.rpartition("/")[2]).max_episode_steps

    def _set(self, steps: int | None) -> None:
        self._set_steps = steps

    max_episode_steps = property(_steps, _set)  # pyright: ignore[reportAssignmentType]
