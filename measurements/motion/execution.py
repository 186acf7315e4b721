"""Carries out planned motions in SAPIEN, and tells whether robots touch in any step of physics."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from experts import follow
from layouts import Layout
from measurements.motion.following import FreeRobots
from motion import Motion
from robots import TaskError


class Stage:
    """A world with the robots of a cell, in which one motion after the other is carried out."""

    def __init__(self, layout: Layout, control_mode: str) -> None:
        """Build the world."""
        scenario = FreeRobots.scenario
        self._task = FreeRobots(
            replace(scenario, layout=layout, control_mode=control_mode, check_layout=False)
        )
        self._task.simulation.backend.watch_arms()

    def close(self) -> None:
        """Take the world down."""
        self._task.close()

    def carry_out(self, motion: Motion) -> dict[str, Any]:
        """Return what came of a motion: whether it was carried out, and which links touched.

        ``stray`` is how far any link was from the plan (m), ``late`` how much longer it took (s).
        """
        task, touching = self._task, dict[str, None]()
        task.starts = {name: rows[0] for name, rows in motion.positions.items()}
        task.reset(0)

        def watch() -> None:
            pairs = task.simulation.backend.arms_touching(0)
            touching.update(dict.fromkeys(f"{one}, {other}" for one, other in pairs))

        watch()
        touching.clear()
        try:
            done = follow(task, motion, watch=watch)
        except TaskError as error:
            return {"executed": False, "touching": list(touching), "refused": str(error)}
        return {
            "executed": True,
            "touching": list(touching),
            "stray": round(max(done.strays.values()), 5),
            "late": round(done.late, 3),
        }
