"""Joint groups with leaders, driven before each of MuJoCo Warp's steps; see `Leaders`."""

from __future__ import annotations

from typing import Any

import numpy as np

from layouts import Layout
from robot_layouts.simulation.mujoco.drives import LedGroup, linkages
from robot_layouts.simulation.mujoco.model import Inventory
from robot_layouts.simulation.mujoco_warp.library import warp


class LinkageDrives:
    """What pulls the joints of all linkages of a layout, in all worlds of a device."""

    def __init__(self, layout: Layout, index: Inventory, device: Any) -> None:
        """Look the joints up.

        Args:
            layout: The robots.
            index: Where everything stands in MuJoCo's model.
            device: Warp's device.
        """
        self._groups = [_numbers(group, index, device) for group in linkages(layout)]

    def pull(self, model: Any, data: Any, targets: Any) -> None:
        """Set what the drives do in the next step.

        Args:
            model: MuJoCo Warp's model.
            data: Its state of the worlds.
            targets: Of position, of all joints, (N, dof) (rad, m).
        """
        for count, numbers in self._groups:
            warp.launch(
                _pull,
                dim=data.nworld,
                inputs=[targets, data.qpos, data.qvel, model.actuator_biasprm, count, *numbers],
                outputs=[data.ctrl],
                device=data.qpos.device,
            )


def _numbers(led: LedGroup, index: Inventory, device: Any) -> tuple[int, list[Any]]:
    """Return how many joints a group has, and what a kernel takes of it."""
    joints, at = index.joints, led.places
    whole = (np.arange(at.start, at.stop), joints.qpos[at], joints.qvel[at], led.leads)
    return len(led.leads), [
        *(warp.array(np.asarray(own, np.int32), dtype=int, device=device) for own in whole),
        *(
            warp.array(np.asarray(own, np.float32), dtype=float, device=device)
            for own in (led.multipliers, led.offsets)
        ),
        float(led.group.lead),
    ]


@warp.kernel
def _pull(
    targets: Any,
    qpos: Any,
    qvel: Any,
    gains: Any,
    count: int,
    driven: Any,
    positions: Any,
    speeds: Any,
    leads: Any,
    multipliers: Any,
    offsets: Any,
    lead: float,
    controls: Any,
) -> None:
    """Pull one world's joints of a group: leaders ahead of where they are, all others there."""
    world = warp.tid()
    # Warp takes what is written 0.0 for a constant.
    value, speed, leaders = float(0.0), float(0.0), float(0.0)  # noqa: UP018
    for joint in range(count):
        if leads[joint] != 0:
            value += (qpos[world, positions[joint]] - offsets[joint]) / multipliers[joint]
            speed += qvel[world, speeds[joint]] / multipliers[joint]
            leaders += 1.0
    value, speed = value / leaders, speed / leaders
    wanted = (targets[world, driven[0]] - offsets[0]) / multipliers[0]
    ahead = warp.clamp(wanted, value - lead, value + lead)
    row = world % gains.shape[0]
    for joint in range(count):
        place, pace = value, multipliers[joint] * speed
        if leads[joint] != 0:
            place, pace = ahead, float(0.0)  # noqa: UP018
        drive = driven[joint]
        target = multipliers[joint] * place + offsets[joint]
        pulled = gains[row, drive][1] * target + gains[row, drive][2] * pace
        controls[world, drive] = -pulled
