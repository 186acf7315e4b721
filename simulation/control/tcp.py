"""TCP control: from action numbers to poses of tool centre points, and on to joint targets."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from robots import JointGroup
from simulation.backend import Backend, PoseFollower
from simulation.control import poses
from simulation.maths import Floats
from simulation.readout import ReadoutIndex
from simulation.state import State

_ROOT = "root_translation"
_ROOT_TURN = "root_aligned"


@dataclass(frozen=True)
class Tool:
    """A joint group whose action numbers ask for a TCP.

    Attributes:
        robot: Name of the robot in the layout.
        arm: Name of the robot or the limb whose TCP it is.
        group: What drives it.
        tcp_link: Link that orients the TCP.
        numbers: Where its action numbers are in the flat action.
        joints: Where its joints are among those of all robots.
        own: Where the robot's joints are among those of all robots.
    """

    robot: str
    arm: str
    group: JointGroup
    tcp_link: str
    numbers: slice
    joints: tuple[int, ...]
    own: slice


class ToolControl:
    """Drives joint groups that take the same command, in all worlds at once."""

    def __init__(self, tools: Sequence[Tool]) -> None:
        """Take what is driven alike."""
        self.tools = tuple(tools)
        group = tools[0].group
        self.delta, self.target = group.delta, group.target
        self._turns = group.asks.turn
        moves, turns = group.frame.split(":")
        self._by_root, self._turn_by_root = moves == _ROOT, turns.startswith(_ROOT_TURN)
        self._normalised = group.normalised
        starts = [tool.numbers.start for tool in tools]
        self._places = np.array([range(start, start + 3) for start in starts])
        self._angles = np.array([range(start + 3, start + 6) for start in starts])
        # Native scales a turn by its lower bound, so that 1 turns backwards.
        lows = [tool.group.ranges[-1][0] for tool in tools]
        self._turn_scale = np.array(lows, np.float32)[:, None]
        self._followers: list[PoseFollower] = []
        self._roots: Floats = np.zeros((0, 7), np.float32)
        self._to_roots = self._roots
        self.poses: Floats = self._roots
        """Where the TCPs were last asked to be in their root frames, (N · tools, 7)."""

    def build(self, backend: Backend, index: ReadoutIndex) -> None:
        """Find the frames, and what solves for joints."""
        links = [(index.links[tool.robot], tool) for tool in self.tools]
        self._tcp_frames = [index.tcps[tool.arm] for tool in self.tools]
        self._link_frames = [link[tool.tcp_link] for link, tool in links]
        self._root_frames = [
            index.bases[tool.robot] if tool.group.root_link is None else link[tool.group.root_link]
            for link, tool in links
        ]
        self._followers = [
            backend.pose_follower(
                tool.robot, tool.tcp_link, tool.group.root_link, tool.group.joints
            )
            for tool in self.tools
        ]

    def begin(self, state: State, env_ids: Iterable[int]) -> None:
        """Let the targets of some worlds be where the TCPs are."""
        now = self.now(state)
        if len(self.poses) != len(now):
            self.poses = now
        for i in env_ids:
            rows = self._rows(i)
            self.poses[rows] = now[rows]

    def now(self, state: State) -> Floats:
        """Return where the TCPs are in their root frames, (N · tools, 7)."""
        return poses.combined(self._from_roots(state), _rows(state, self._tcp_frames))

    def ask(self, action: Floats, scaled: Floats, state: State) -> Floats:
        """Return where the TCPs are to be, (N · tools, 7).

        Args:
            action: Actions, (N, A).
            scaled: The same, clipped, and scaled to metres.
            state: The worlds before the step.
        """
        places = scaled[:, self._places].reshape(-1, 3)
        turns = self._turned(action) if self._turns else None
        if not self.delta:
            assert turns is not None
            return np.concatenate([places, turns], 1)
        before = self.poses if self.target else self.now(state)
        spots, ways = before[:, :3], before[:, 3:]
        moved = places if self._by_root else poses.turned(ways, places)
        if turns is not None:
            pair = (turns, ways) if self._turn_by_root else (ways, turns)
            ways = poses.product(*pair)
        return np.concatenate([spots + moved, poses.upright(ways)], 1)

    def follow(self, wanted: Floats, state: State, env_ids: Iterable[int], targets: Floats) -> None:
        """Write the joint targets that bring TCPs where they are wanted; they stay where they fail.

        Args:
            wanted: Poses of the TCPs, (N · tools, 7).
            state: The worlds before the step.
            env_ids: Which worlds.
            targets: Joint targets, (N, dof) (rad, m), which hold the present joints.
        """
        if self._tcp_frames != self._link_frames:
            wanted = self._of_links(wanted, state)
        qpos = state.joint_positions
        for i in env_ids:
            for tool, follower, row in zip(
                self.tools, self._followers, range(self._rows(i).start, len(wanted)), strict=False
            ):
                pose = wanted[row]
                found = follower.follow(pose[:3], pose[3:], qpos[i, tool.own])
                if found is not None:
                    targets[i, tool.joints] = found

    def keep(self, wanted: Floats, env_ids: Iterable[int]) -> None:
        """Let the targets of some worlds be poses, (N · tools, 7)."""
        for i in env_ids:
            rows = self._rows(i)
            self.poses[rows] = wanted[rows]

    # -- inside ------------------------------------------------------------------------------

    def _rows(self, env: int) -> slice:
        count = len(self.tools)
        return slice(env * count, (env + 1) * count)

    def _turned(self, action: Floats) -> Floats:
        angles = action[:, self._angles].reshape(-1, 3)
        if self._normalised:
            angles = poses.clipped_turn(angles).reshape(-1, len(self.tools), 3)
            angles = (angles * self._turn_scale).reshape(-1, 3)
        return poses.rotation(angles)

    def _from_roots(self, state: State) -> Floats:
        """Return the inverses of the root links' poses, which seldom move."""
        roots = _rows(state, self._root_frames)
        if not np.array_equal(roots, self._roots):
            self._roots, self._to_roots = roots, poses.inverse(roots)
        return self._to_roots

    def _of_links(self, wanted: Floats, state: State) -> Floats:
        """Return poses of the links that orient TCPs, of poses of the TCPs, which hang on them."""
        tcps, links = (_rows(state, frames) for frames in (self._tcp_frames, self._link_frames))
        return poses.combined(wanted, poses.combined(poses.inverse(tcps), links))


def _rows(state: State, frames: list[int]) -> Floats:
    """Return the poses of frames, those of a world after one another, (N · frames, 7)."""
    if len(frames) == 1:
        return state.all_poses[frames[0]]
    return state.all_poses[frames].swapaxes(0, 1).reshape(-1, 7)
