"""Worlds of one model on a device, stepped, read and begun anew together."""

from __future__ import annotations

import copy
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor

from robot_layouts.simulation.backend import Pair, Readout, Velocity
from robot_layouts.simulation.mujoco import mujoco
from robot_layouts.simulation.mujoco.world import MujocoWorld
from robot_layouts.simulation.mujoco_warp.kernels import (
    ContactForces,
    LinkageDrives,
    mujoco_warp,
    warp,
)
from robot_layouts.simulation.mujoco_warp.state import beside
from robots import SimulationError

# Room for contacts in each world: as many as at its start, as many as hands add, and as many again.
_CONTACTS = 48
_NEAR = 1e-3  # m: how near is a contact, when they are counted
_AXES = 3  # constraints of a contact
_STATE = ("qpos", "mocap_pos", "mocap_quat")
_NO_ROOM = ("NEFC", "NJMAX_NNZ", "BROADPHASE", "NARROWPHASE", "CCD")


# What of a model a variation changes; see `MujocoWorld.vary`.
_VARIED = (
    *("actuator_acc0", "actuator_biasprm", "body_gravcomp", "body_inertia", "body_invweight0"),
    *("body_mass", "body_pos", "body_quat", "body_subtreemass", "dof_invweight0"),
    *("geom_friction", "pair_friction"),
)


@dataclass(frozen=True)
class Starts:
    """How episodes begin.

    Attributes:
        rows: By MuJoCo's name, what a world begins with, a row for each, (K, …): of its state
            ``qpos``, ``mocap_pos`` and ``mocap_quat``, and of its model what varies.
    """

    rows: Mapping[str, Tensor]

    @classmethod
    def of(cls, worlds: Iterable[MujocoWorld], device: torch.device) -> Starts:
        """Return how worlds of MuJoCo's stand, each looked at before the next is asked for."""
        found = [
            {name: np.array(getattr(world.data, name), np.float32) for name in _STATE}
            | {name: np.array(getattr(world.model, name), np.float32) for name in _VARIED}
            for world in worlds
        ]
        return cls(
            {
                name: torch.from_numpy(np.stack([row[name] for row in found])).to(device)
                for name in (*_STATE, *_VARIED)
            }
        )

    def without_constants(self, model: Any) -> Starts:
        """Return them without what is in all of them as it is in MuJoCo's model."""

        def varies(name: str) -> bool:
            usual = torch.from_numpy(np.array(getattr(model, name), np.float32))
            return bool((self.rows[name] != usual.to(self.rows[name].device)).any())

        kept = {name: own for name, own in self.rows.items() if name in _STATE or varies(name)}
        return Starts(kept)

    def and_then(self, more: Starts) -> Starts:
        """Return these, and others after them."""
        return Starts({name: torch.cat((own, more.rows[name])) for name, own in self.rows.items()})

    def take(self, rows: Tensor) -> Starts:
        """Return some of them, by their numbers."""
        return Starts({name: own[rows] for name, own in self.rows.items()})


class DeviceWorlds:
    """N worlds of one model on a device: what `Moment` and `DeviceSimulation` ask of a backend.

    Attributes:
        count: Number of worlds N.
        device: Where they are.
    """

    def __init__(
        self,
        world: MujocoWorld,
        starts: Starts,
        count: int,
        *,
        contacts: int | None = None,
    ) -> None:
        """Put a world of MuJoCo's on the device that its starts are on, so many times.

        Args:
            world: It.
            starts: How episodes begin there, which says what varies.
            count: How many worlds there are to be.
            contacts: How many contacts there is room for in each; None for enough for hands.

        Raises:
            SimulationError: If the device has not memory enough, or MuJoCo Warp lacks what the
                model needs.
        """
        self.count, self.device = count, starts.rows["qpos"].device
        device = self.device
        self._index, self._declared = world.index, world.declared
        self._host = model = copy.copy(world.model)
        model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)  # unknown there
        self._warp_device = warp.device_from_torch(device)
        room = 2 * _contacts_at(world) + _CONTACTS if contacts is None else contacts
        rows = _AXES * room + model.nv + 6 * model.neq + int((model.dof_frictionloss > 0).sum())
        with _expecting_room(count, device), warp.ScopedDevice(self._warp_device):
            varied = [name for name in starts.rows if name not in _STATE]
            self._model = mujoco_warp.put_model(model, dict.fromkeys(varied, count))
            self._model.opt.warn_overflow = 0  # it is in `overflowed`
            self._data = mujoco_warp.make_data(model, count, nconmax=room, njmax=rows)
        view = warp.to_torch
        data = self._data
        self._qpos, self._qvel, self._ctrl = view(data.qpos), view(data.qvel), view(data.ctrl)
        self._owners = {name: view(getattr(data, name)) for name in _STATE}
        self._owners |= {name: view(getattr(self._model, name)) for name in varied}
        self._mocap = self._owners["mocap_pos"], self._owners["mocap_quat"]
        self._bodies = view(data.xpos), view(data.xquat)
        self._overflow = view(data.overflow)
        self._full = sum(int(getattr(mujoco_warp.OverflowType, name)) for name in _NO_ROOM)
        gains = view(self._model.actuator_biasprm)
        self._springs, self._dampers = gains[..., 1], gains[..., 2]
        self._linkages = LinkageDrives(world.declared.layout, world.index, self._warp_device)
        self._targets = torch.zeros((count, model.nu), device=device)
        places = world.index.joints
        self._joints = [torch.from_numpy(own).to(device) for own in (places.qpos, places.qvel)]
        turned = world.index.turned
        self._hinges = torch.from_numpy(turned.hinges.astype("int64")).to(device)
        self._carried = torch.from_numpy(turned.carried.T.astype("float32")).to(device)
        self._roots = torch.from_numpy(model.body_rootid.astype("int64")).to(device)
        self._touched = torch.zeros(count, dtype=torch.bool, device=device)  # since its reset
        self._forces: dict[tuple[Pair, ...], ContactForces] = {}
        self._found: dict[tuple[Velocity, ...], tuple[Tensor, Tensor]] = {}
        self._works: dict[str, Any] = {}  # graphs, None as long as there is none
        self._located = False

    # -- motion ------------------------------------------------------------------------------

    def drive(self, targets: Any, velocities: Any | None) -> None:
        """Set what all joints are driven to, (N, dof) each (rad, m, and per s)."""
        pulls = -self._springs * targets
        if velocities is not None:
            pulls = pulls - self._dampers * velocities
        self._ctrl.copy_(pulls)
        self._targets.copy_(targets)

    def step(self, count: int) -> None:
        """Advance all worlds by some of MuJoCo's steps; see `MujocoWorld.step`."""

        def advance() -> None:
            self._data.qacc_warmstart.zero_()
            targets = warp.from_torch(self._targets)
            for _ in range(count):
                self._linkages.pull(self._model, self._data, targets)
                mujoco_warp.step(self._model, self._data)

        self._do(f"{count} steps", advance)
        self._touched.fill_(True)
        self._located = False

    def begin(self, where: Tensor, starts: Starts) -> None:
        """Let some worlds stand as episodes begin, at rest.

        Args:
            where: Which, (N,) bool.
            starts: How each would, N rows.
        """
        for name, rows in starts.rows.items():
            own = self._owners[name]
            own.copy_(torch.where(beside(where, rows), rows, own))
        self._qvel.masked_fill_(where[:, None], 0.0)
        self._overflow.masked_fill_(where, 0)
        self._touched &= ~where
        self._located = False

    def place(self, body: str, pose: Tensor, where: Tensor) -> None:
        """Move a body in some worlds; it goes on as fast.

        Args:
            body: Its name.
            pose: Place (m) and orientation (wxyz), (N, 7).
            where: In which worlds, (N,) bool.
        """
        model, number = self._host, self._index.body(None, body)
        if (held := model.body_mocapid[number]) >= 0:
            owners = [
                (self._mocap[0][:, held], pose[:, :3]),
                (self._mocap[1][:, held], pose[:, 3:]),
            ]
        else:
            at = model.jnt_qposadr[model.body_jntadr[number]]
            owners = [(self._qpos[:, at : at + 7], pose)]
        for own, rows in owners:
            own.copy_(torch.where(where[:, None], rows, own))
        self._located = False

    # -- reading -----------------------------------------------------------------------------

    def read(self) -> Readout:
        """Return poses and joints of all worlds; they stay as they are when the worlds move on."""
        self._locate()
        places, turns = self._bodies
        beyond = torch.cos(self._qpos[:, self._hinges] / 2) < 0  # see `Turned`
        odd = torch.remainder(beyond.float() @ self._carried, 2.0)
        turns = turns * (1.0 - 2.0 * odd)[..., None]
        poses: Any = torch.cat((places, turns), -1)[:, 1:].transpose(0, 1).contiguous()
        qpos, qvel = self._joints
        joints: Any = self._qpos[:, qpos], self._qvel[:, qvel]
        return Readout(poses, *joints)

    def velocities(self, wanted: tuple[Velocity, ...]) -> Any:
        """Return velocities of bodies' centres of mass, (K, N, 3) (m/s, rad/s, world frame)."""
        self._locate()
        if wanted not in self._found:
            bodies = [self._index.body(None, name) for name, _ in wanted]
            spins = torch.tensor([[kind == "angular"] for _, kind in wanted], device=self.device)
            self._found[wanted] = torch.tensor(bodies, device=self.device), spins
        bodies, spins = self._found[wanted]
        data, roots = self._data, self._roots
        both, middles, centres = map(warp.to_torch, (data.cvel, data.xipos, data.subtree_com))
        spin, speed = both[:, bodies, :3], both[:, bodies, 3:]
        arm = middles[:, bodies] - centres[:, roots[bodies]]
        speed = speed + torch.linalg.cross(spin, arm)
        return torch.where(spins, spin, speed).transpose(0, 1)

    def root_velocities(self) -> Any:
        """Return velocities of the robots' roots, which are fixed, (R, N, 6)."""
        return torch.zeros((len(self._index.robots), self.count, 6), device=self.device)

    def body_joints(self, body: str) -> Any:
        """Return positions, then velocities of a body's joints, (N, 2 · joints)."""
        joints = self._index.jointed[body]
        rows = [self._qpos[:, i] for i in joints.qpos.tolist()]
        rows += [self._qvel[:, i] for i in joints.qvel.tolist()]
        return torch.stack(rows, 1)

    def forces(self, pairs: tuple[Pair, ...]) -> Any:
        """Return contact forces of the last step of physics, (P, N, 3) (N, world frame)."""
        if pairs not in self._forces:
            self._forces[pairs] = ContactForces(pairs, self._host, self._index, self._warp_device)
        with self._in_turn():
            forces = self._forces[pairs].read(self._data)
        return forces * self._touched[:, None]

    @property
    def overflowed(self) -> Tensor:
        """Where a contact was left out since the reset, as there was no room for it, (N,) bool."""
        return (self._overflow & self._full) != 0

    # -- inside ------------------------------------------------------------------------------

    def _locate(self) -> None:
        """Compute where all bodies are and how fast, unless that is known."""
        if self._located:
            return

        def locate() -> None:
            mujoco_warp.kinematics(self._model, self._data)
            mujoco_warp.com_pos(self._model, self._data)
            mujoco_warp.com_vel(self._model, self._data)

        self._do("locate", locate)
        self._located = True

    def _do(self, name: str, work: Callable[[], None]) -> None:
        """Do work of MuJoCo Warp's; on a card from the second time on as a graph that it keeps."""
        if self.device.type == "cuda" and self._works.get(name, False) is None:
            with warp.ScopedDevice(self._warp_device), warp.ScopedCapture() as capture:
                work()
            self._works[name] = capture.graph
        with self._in_turn():
            if (graph := self._works.get(name)) is None:
                self._works[name] = None
                work()
            else:
                warp.capture_launch(graph)

    @contextmanager
    def _in_turn(self) -> Generator[None]:
        """Let what Warp does come after what torch did before, and before what it does next."""
        with warp.ScopedDevice(self._warp_device):
            if self.device.type == "cpu":
                yield
                return
            own: Any = torch.cuda.ExternalStream(self._warp_device.stream.cuda_stream)
            torchs = torch.cuda.current_stream(self.device)
            own.wait_stream(torchs)
            yield
            torchs.wait_stream(own)


def _contacts_at(world: MujocoWorld) -> int:
    """Return how many contacts a world has as it stands, once things have sunk onto each other."""
    model, data = copy.copy(world.model), copy.copy(world.data)
    model.geom_margin += _NEAR
    mujoco.mj_fwdPosition(model, data)
    return data.ncon


@contextmanager
def _expecting_room(count: int, device: torch.device) -> Generator[None]:
    """Say what to do where a device has too little memory for so many worlds."""
    try:
        yield
    except NotImplementedError as error:
        raise SimulationError(f"MuJoCo Warp cannot do what this task needs: {error}") from error
    except RuntimeError as error:
        if "alloc" not in str(error).lower() and "memory" not in str(error).lower():
            raise
        raise SimulationError(
            f"{count} worlds need more memory than {device} has; take fewer (num_envs), or less"
            f" room for contacts in each (contacts): {error}"
        ) from error
