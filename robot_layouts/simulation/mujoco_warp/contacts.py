"""Contact forces between pairs of bodies, in all worlds of a device at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor

from robot_layouts.simulation.backend import Pair
from robot_layouts.simulation.mujoco.model import Inventory
from robot_layouts.simulation.mujoco_warp.library import warp

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
