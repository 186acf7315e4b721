"""MuJoCo Warp, and what its kernels compute for all worlds of a device.

Those are contact forces between pairs of bodies, and what pulls joint groups with leaders; see
`Leaders`. The package need not be installed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from layouts import Layout
from robot_layouts.core.importing import optional
from robot_layouts.simulation.backend import Pair
from robot_layouts.simulation.control.joint_positions import LedGroup, linkages
from robot_layouts.simulation.mujoco.model import Inventory

_WHAT = "simulator='mujoco_warp' needs MuJoCo Warp"

warp = optional("warp", _WHAT, "mujoco_warp")
"""What compiles kernels for a device.

Raises:
    MissingPackageError: While this is imported, if it is not installed.
"""
warp.config.log_level = warp.LOG_ERROR  # it warns where there is no card
warp.init()

mujoco_warp = optional("mujoco_warp", _WHAT, "mujoco_warp")
"""MuJoCo in such kernels.

Raises:
    MissingPackageError: While this is imported, if it is not installed.
"""

_ANY = -1  # in the place of a body: whatever touches the link
_AXES = 3  # numbers of a contact's force; what is beyond are moments


class ContactForces:
    """Reads the contact forces of the same pairs, step after step."""

    def __init__(self, pairs: Sequence[Pair], model: Any, index: Inventory, device: str) -> None:
        """Look the pairs up.

        Args:
            pairs: Links and bodies.
            model: MuJoCo's model, on the host.
            index: Where everything stands in it.
            device: The device's name.
        """
        find, self._count = index.body, len(pairs)
        links = [find(robot, link) for robot, link, _ in pairs]
        bodies = [_ANY if body is None else find(None, body) for *_, body in pairs]
        self._links, self._bodies, self._owners = (
            warp.array(np.array(numbers, np.int32), dtype=int, device=device)
            for numbers in (links, bodies, model.geom_bodyid)
        )

    def read(self, data: Any) -> Tensor:
        """Return the forces of the last step of physics, (P, N, 3) (N, world frame).

        Args:
            data: MuJoCo Warp's state of the worlds.
        """
        device = warp.device_to_torch(data.qpos.device)
        forces = torch.zeros((self._count, data.nworld, _AXES), device=device)
        contact = data.contact
        warp.launch(
            _add_forces,
            dim=data.naconmax,
            inputs=[
                data.nacon,
                data.naconmax,
                data.njmax,
                contact.worldid,
                contact.geom,
                contact.dim,
                contact.efc_address,
                contact.frame,
                data.efc.force,
                self._owners,
                self._links,
                self._bodies,
                self._count,
            ],
            outputs=[warp.from_torch(forces, dtype=warp.vec3)],
            device=data.qpos.device,
        )
        return forces


@warp.kernel
def _add_forces(
    found: Any,
    most: int,
    rows: int,
    worlds: Any,
    geoms: Any,
    axes: Any,
    addresses: Any,
    frames: Any,
    strengths: Any,
    owners: Any,
    links: Any,
    bodies: Any,
    pairs: int,
    forces: Any,
) -> None:
    """Add one contact's force to those of its pairs; see MuJoCo's ``mj_contactForce``."""
    contact = warp.tid()
    if contact >= warp.min(found[0], most):
        return
    first = addresses[contact, 0]
    if first < 0:
        return
    world = worlds[contact]
    along = warp.vec3(0.0, 0.0, 0.0)
    for axis in range(3):
        if axis < axes[contact]:
            row = addresses[contact, axis]
            if row < rows:
                along[axis] = strengths[world, row]
    force = along * frames[contact]  # on the second body
    both = geoms[contact]
    one, other = owners[both[0]], owners[both[1]]
    for pair in range(pairs):
        if other == links[pair] and (bodies[pair] < 0 or one == bodies[pair]):
            warp.atomic_add(forces, pair, world, force)
        if one == links[pair] and (bodies[pair] < 0 or other == bodies[pair]):
            warp.atomic_add(forces, pair, world, -force)


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
