"""Control of worlds on a device: actions become targets of all joints, world by world at once."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from layouts import Layout
from robot_layouts.kinematics.chain import Chain
from robot_layouts.kinematics.quaternions import multiplied
from robot_layouts.simulation.control.joint_positions import DrivenGroup, JointPositionController
from robot_layouts.simulation.control.modes import ModeController
from robot_layouts.simulation.control.tcp import TcpController, inverse
from robot_layouts.simulation.mujoco_warp.state import (
    DeviceIndex,
    DeviceState,
    beside,
    move_arrays,
    rotation_matrix,
)
from robot_layouts.simulation.solvers import FOLLOWING, TreeFollower
from robots import SimulationError

_STEPS = 12  # of Newton's method, which squares its error in each; what is near takes four
_LONGEST = 0.4  # way of a joint in a step (rad or m)
_DAMPING = 1e-6  # m², rad²
_SMALL = 1e-6  # below it, a sine is its angle (rad)

Columns = tuple[Any, ...]  # numbers of places and quaternions, (N,) each


class DeviceChain(Chain):
    """A chain of links, in float64 tensors, whose search has a pose for each world."""

    def __init__(self, chain: Chain, free: list[int], device: torch.device) -> None:
        """Take a chain, and which coordinates may move."""
        vars(self).update(vars(chain))
        self._free = torch.eye(len(self._endless), dtype=torch.float64)[free].to(device)
        sliding = torch.zeros(len(self._drivers), 1, dtype=torch.bool)
        sliding[torch.from_numpy(self._slides)] = True
        self._sliding = sliding.to(device)
        move_arrays(self, device)
        self._drives = self._free[:, self._drivers].T

    def follow(self, pose: Tensor, qpos: Tensor) -> tuple[Tensor, Tensor]:
        """Return coordinates that bring the end to poses, and where some do; see `Chain.search`.

        Args:
            pose: Of the end in the root's frame, (N, 4, 4) (m).
            qpos: All coordinates, (N, coordinates) (rad, m).

        Returns:
            All coordinates, (N, coordinates) (rad, m), and flags, (N,).
        """
        tail: Any = self._tail
        wanted, start = pose @ torch.linalg.inv_ex(tail)[0], qpos
        twists = _twists(self._links(start)[-1], wanted)
        error, near = torch.linalg.vector_norm(twists, dim=1), FOLLOWING.tolerance
        remaining = torch.tensor(1.0 - FOLLOWING.share, dtype=torch.float64)
        steps = torch.floor(torch.log(near / error) / torch.log(remaining).item()) + 1
        left = torch.where(error >= near, (1.0 - FOLLOWING.share) ** steps, 0.0)
        for _ in range(_STEPS):
            links = self._links(qpos)
            ways = self._ways(links, _errors(links[-1], wanted))
            qpos = qpos + ways.clamp(-_LONGEST, _LONGEST) @ self._free
        links = self._links(qpos)
        missing = torch.linalg.vector_norm(_errors(links[-1], wanted), dim=1)
        qpos = qpos - self._ways(links, left[:, None] * twists) @ self._free
        turned = torch.remainder(qpos + torch.pi, 2 * torch.pi) - torch.pi
        endless: Any = self._endless
        qpos = torch.where(endless, turned, qpos)
        moved = (left > 0)[:, None]
        arrived = (missing < near) & (steps <= FOLLOWING.steps) | (error < near)
        return torch.where(moved, qpos, start), arrived

    def _links(self, qpos: Tensor) -> Tensor:
        """Return the poses of the root and of the links that move, (k + 1, N, 4, 4)."""
        multipliers: Any = self._multipliers
        offsets: Any = self._offsets
        positions = qpos.T[self._drivers] * multipliers[:, None] + offsets[:, None]
        sines = torch.where(self._sliding, positions, positions.sin())
        basis = torch.stack((torch.ones_like(positions), sines, positions.cos()), -1)
        terms: Any = self._terms
        motions = (basis @ terms).unflatten(-1, (4, 4))
        links = [torch.eye(4, dtype=qpos.dtype, device=qpos.device).expand(len(qpos), 4, 4)]
        for motion in motions:
            links.append(links[-1] @ motion)
        return torch.stack(links)

    def _ways(self, links: Tensor, errors: Tensor) -> Tensor:
        """Return the ways of the joints that may move which correct errors, (N, free)."""
        moved, last = links[1:, :, :3], links[-1, :, :3]
        own: Any = self._axes
        axes = (moved[..., :3] @ own)[..., 0]
        arms = torch.linalg.cross(axes, last[..., 3] - moved[..., 3])
        sliding = self._sliding[..., None]
        both = torch.stack((torch.where(sliding, axes, arms), torch.where(sliding, 0.0, axes)), 2)
        slopes = (both @ last[..., :3]).flatten(2).permute(1, 2, 0) @ self._drives
        across = slopes.transpose(1, 2)
        damped = slopes @ across + _DAMPING * torch.eye(6, dtype=links.dtype, device=links.device)
        return (across @ torch.linalg.solve_ex(damped, errors[..., None])[0])[..., 0]


class DeviceFollower(TreeFollower):
    """Follows poses of a link of a robot, in all worlds; see `TreeFollower`."""

    def on(self, device: torch.device) -> DeviceChain:
        """Return its chain on a device."""
        return DeviceChain(self._chain, self._free, device)


def _upright(turn: Columns) -> Columns:
    """Return quaternions with w ≥ 0."""
    sign = torch.where(turn[0] < 0, -1.0, 1.0)
    return tuple(sign * number for number in turn)


class DeviceTcp(TcpController):
    """Drives a joint group by the pose of its TCP, in all worlds at once; see `TcpController`."""

    _upright = staticmethod(_upright)

    def __init__(self, tool: DrivenGroup, layout: Layout, device: torch.device) -> None:
        """Take what is driven.

        Raises:
            SimulationError: If it goes as near to poses as it gets.
        """
        super().__init__(tool, layout)
        group = tool.group
        if group.approximates:
            raise SimulationError(
                f"{tool.arm!r} goes as near to a pose of its TCP as it gets, which simulator"
                " 'mujoco_warp' does not do; take a control_mode of joints, such as"
                " 'pd_joint_delta_pos'"
            )
        follower = DeviceFollower(
            self._robot, self._limb.tcp_link, group.root_link, list(group.joints)
        )
        self._chain = follower.on(device)

    def restart(self, state: DeviceState, where: Tensor) -> None:
        """Let the targets of some worlds be where the TCPs are."""
        now = torch.stack(self._present(state), 1)
        before: Any = self.targets if len(self.targets) == len(now) else now
        vars(self)["targets"] = torch.where(beside(where, now), now, before)

    def sent(self, action: Any, scaled: Any, state: DeviceState) -> Tensor:
        """Return the joints to which an action sends a group, or those that it has, (N, joints).

        Args:
            action: (N, A).
            scaled: The same, clipped and scaled to metres.
            state: The worlds before the step.
        """
        wanted = self._sent_to(action, scaled, state)
        if self.tool.group.target:
            vars(self)["targets"] = torch.stack(wanted, 1)
        place = torch.stack(self._at_link(wanted, state), 1).double()
        pose = torch.zeros((len(place), 4, 4), dtype=place.dtype, device=place.device)
        pose[:, :3, :3], pose[:, :3, 3] = rotation_matrix(place[:, 3:]), place[:, :3]
        pose[:, 3, 3] = 1.0
        joints: Any = state.joint_positions
        found, arrived = self._chain.follow(pose, joints[:, self.tool.own].double())
        present = joints[:, self.tool.joints]
        return torch.where(arrived[:, None], found[:, self._own].float(), present)

    # -- inside ------------------------------------------------------------------------------

    def _sent_to(self, action: Any, scaled: Any, state: DeviceState) -> Columns:
        """Return where the TCP is to be, in its root link's frame."""
        group, place = self.tool.group, _columns(scaled[:, self._place])
        turn = self._turning(action) if group.asks.turn else None
        before = _columns(self.targets) if group.target else self._present(state)
        return self._asked(place, turn, before)

    def _turning(self, action: Any) -> Columns:
        angles = action[:, self._angles]
        if self.tool.group.normalised:
            length = torch.linalg.vector_norm(angles, dim=1, keepdim=True)
            angles = angles / length.clamp(min=1.0) * float(self._turn_scale)
        (cx, cy, cz), (sx, sy, sz) = (_columns(f(angles / 2)) for f in (torch.cos, torch.sin))
        none = torch.zeros_like(cx)
        turns = (cx, sx, none, none), (cy, none, sy, none), (cz, none, none, sz)
        return _upright(multiplied(multiplied(turns[0], turns[1]), turns[2]))

    def _present(self, state: DeviceState) -> Columns:
        """Return where the TCP is, in its root link's frame."""
        root, tcp = (_columns(state.all_poses[f]) for f in (self._root_frame, self._tcp_frame))
        return self._combined(inverse(root), tcp)

    def _at_link(self, wanted: Columns, state: DeviceState) -> Columns:
        """Return where the link that orients the TCP is, if the TCP is where it is wanted."""
        if self._tcp_frame == self._link_frame:
            return wanted
        tcp, link = (_columns(state.all_poses[f]) for f in (self._tcp_frame, self._link_frame))
        return self._combined(wanted, self._combined(inverse(tcp), link))


def _columns(rows: Any) -> Columns:
    return rows.unbind(-1)


def _errors(poses: Tensor, wanted: Tensor) -> Tensor:
    """Return what poses miss of others, place and turn in their own frames, (N, 6) (m, rad)."""
    back = poses[:, :3, :3].transpose(1, 2)
    place = (back @ (wanted - poses)[:, :3, 3:])[..., 0]
    return torch.cat((place, _turn_vector(back @ wanted[:, :3, :3])), 1)


def _twists(poses: Tensor, wanted: Tensor) -> Tensor:
    """Return the constant twists that lead from poses to others, (N, 6) (m, rad); see `screw`."""
    place, turn = _errors(poses, wanted).split(3, 1)
    angle = torch.linalg.vector_norm(turn, dim=1, keepdim=True)
    small = angle < 1e-3  # a series is taken then
    safe = torch.where(small, 1.0, angle)
    factor = (1 - safe / (2 * torch.tan(safe / 2))) / safe**2
    factor = torch.where(small, 1 / 12 + angle**2 / 720, factor)
    aside = torch.linalg.cross(turn, place)
    return torch.cat((place - aside / 2 + factor * torch.linalg.cross(turn, aside), turn), 1)


def _turn_vector(turns: Tensor) -> Tensor:
    """Return axis times angle of rotation matrices, (N, 3) (rad)."""
    twice = torch.stack(
        (
            turns[:, 2, 1] - turns[:, 1, 2],
            turns[:, 0, 2] - turns[:, 2, 0],
            turns[:, 1, 0] - turns[:, 0, 1],
        ),
        1,
    )
    sine = torch.linalg.vector_norm(twice, dim=1, keepdim=True) / 2
    cosine = (turns.diagonal(dim1=1, dim2=2).sum(1, keepdim=True) - 1) / 2
    small = sine < _SMALL
    return twice * torch.where(
        small, 0.5, torch.atan2(sine, cosine) / torch.where(small, 1.0, 2 * sine)
    )


class DevicePositions(JointPositionController):
    """Drive targets of joint positions, as tensors of a device."""

    def __init__(self, layout: Layout, device: torch.device) -> None:
        """Lay out the robots' action numbers and joints."""
        super().__init__(layout)
        move_arrays(self, device)

    def targets(self, action: Any, qpos: Any) -> Any:
        """Return the drive targets of a batch of actions; see `JointPositionController`."""
        highest: Any = self._highest
        clipped = torch.clamp(action, -highest, highest)
        driving = clipped if self._one_to_one else clipped[:, self._source]
        return self._centre + self._half_range * driving + qpos * self._relative


class DeviceControl(ModeController):
    """Control in any mode, in all worlds of a device at once."""

    def __init__(self, layout: Layout, device: torch.device) -> None:
        """Sort out what is driven in which way.

        Raises:
            SimulationError: If an arm goes as near to poses of its TCP as it gets.
        """
        super().__init__(layout, DevicePositions(layout, device))
        self._arms = {
            key: DeviceTcp(control.tool, layout, device) for key, control in self._tools.items()
        }
        self._tools.update(self._arms)
        move_arrays(self, device)

    def find(self, index: DeviceIndex) -> None:
        """Find frames in worlds that were built."""
        for arm in self._arms.values():
            arm.find(index)

    def restart(self, state: DeviceState, where: Tensor) -> None:
        """Let what is remembered of some worlds, (N,) bool, be how they are."""
        present: Any = state.joint_positions
        if len(self.targets) != state.num_envs:
            self.targets = present.clone()
        before: Any = self.targets
        vars(self)["targets"] = torch.where(where[:, None], present, before)
        for arm in self._arms.values():
            if arm.tool.group.target:
                arm.restart(state, where)

    def driven(self, action: Any, state: DeviceState) -> tuple[Any, Any | None]:
        """Return what joints are driven to, and remember it; see `ModeController.command`."""
        present: Any = state.joint_positions
        before: Any = self.targets
        from_target: Any = self._from_target
        base: Any = torch.where(from_target, before, present) if self._any_target else present
        targets: Any = self._positions.targets(action, base)
        scaled = self._scaled(action)
        for arm in self._arms.values():
            targets[:, arm.tool.joints] = arm.sent(action, scaled, state)
        self.targets = targets
        return targets, self._velocities(present, scaled) if self.moves else None
