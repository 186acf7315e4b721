"""``python -m measurements.motion.following``: how near robots stay to planned motions in SAPIEN.

Plans motions to random reachable places in several cells, carries each out in every control mode,
and prints the largest distances from the plan.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from experts import Followed, follow
from kinematics.rotations import Floats
from layouts import Layout, face_to_face, ring
from motion import Motion, NoPlanError, TcpGoal, plan
from robots import CONTROL_MODES, RobotLayoutsError
from robots.common.commands import exit_code, start
from simulation import State, World
from tasks import EpisodeRandom, MultiRobotTask

CELLS: Mapping[str, Layout] = {
    "two pandas": face_to_face({"left": "panda", "right": "panda"}, spacing=1.4),
    "panda, xarm7": face_to_face({"left": "panda", "right": "xarm7"}, spacing=1.4),
    "so100, koch": face_to_face({"left": "so100", "right": "koch"}, spacing=0.55),
    "ur5, z1": face_to_face({"left": "ur5_gripper", "right": "z1"}, spacing=1.3),
    "four pandas": ring(dict.fromkeys(("south", "east", "north", "west"), "panda"), radius=0.75),
}
SPREAD = 0.6  # of an arm's reach: how far from the middle goals may be, along each axis
HEIGHTS = 0.3, 0.7  # of goals, in the same shares


class FreeRobots(MultiRobotTask):
    """Robots that stand where their layout starts them, and nothing else.

    Attributes:
        starts: Joint positions of those that begin elsewhere (rad, m).
    """

    layout = CELLS["two pandas"]
    robot_counts = range(1, 9)
    max_episode_steps = 10_000
    starts: Mapping[str, Floats] = MappingProxyType({})

    def build(self, world: World) -> None:
        """Add nothing."""

    def sample(self, world: World, rng: EpisodeRandom) -> None:
        """Place nothing."""

    def reset_robots(self, world: World, rng: EpisodeRandom) -> None:
        """Stand the robots where they start, without noise."""
        for name, placement in self.layout.items():
            world.stand(name, self.starts.get(name, placement.start_qpos))

    def evaluate(self, state: State) -> dict[str, Any]:
        """Nothing is ever achieved."""
        return {"success": state.array(np.zeros(state.num_envs)) > 1}


class Row(NamedTuple):
    """What came of some motions in a cell and a control mode.

    Attributes:
        motions: How many were carried out.
        refused: How many did not arrive.
        joints: The largest distance of a joint from the plan (rad, m).
        tcp: Of a tool centre point (m).
        stray: Of any link (m).
        late: The most time that one took longer than planned (s).
        contacts: In how many robots touched each other.
    """

    motions: int
    refused: int
    joints: float
    tcp: float
    stray: float
    late: float
    contacts: int


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m measurements.motion.following")
    add = parser.add_argument
    add("--motions", type=int, default=5, metavar="N", help="of each cell (%(default)s)")
    add("--velocity", type=float, default=1.0, metavar="SHARE", help="of the largest (%(default)s)")
    add("--cell", action="append", choices=CELLS, metavar="NAME", help=f"of {', '.join(CELLS)}")
    add("--mode", action="append", choices=CONTROL_MODES, metavar="MODE", help="only this one")
    options = parser.parse_args(arguments)
    return exit_code(lambda: _measure(options))


def _measure(options: argparse.Namespace) -> None:
    head = (
        "cell, mode, motions, not arrived, joints (mrad), TCP (mm), links (mm), late (s), touched"
    )
    print(head.replace(", ", " | "))
    for name in options.cell or CELLS:
        goals = list(_goals(CELLS[name], options.motions))
        for mode in options.mode or CONTROL_MODES:
            row = measured(CELLS[name], goals, mode, options.velocity)
            print(
                f"{name} | {mode} | {row.motions} | {row.refused} | {1e3 * row.joints:.1f}"
                f" | {1e3 * row.tcp:.2f} | {1e3 * row.stray:.2f} | {row.late:.2f} | {row.contacts}",
                flush=True,
            )


def measured(
    layout: Layout, goals: Sequence[Mapping[str, Sequence[float]]], mode: str, velocity: float
) -> Row:
    """Plan motions to some goals and carry them out in a control mode."""
    scenario = replace(FreeRobots.scenario, layout=layout, control_mode=mode, check_layout=False)
    task, done, refused = FreeRobots(scenario), list[Followed](), 0
    for joints in goals:
        task.reset(0, options={"reconfigure": True})
        motion = plan(layout, goals=joints, control_mode=mode, velocity=velocity)
        try:
            done.append(follow(task, motion))
        except RobotLayoutsError:
            refused += 1
    task.close()
    return Row(
        len(goals),
        refused,
        max((float(e.max()) for f in done for e in f.joint_errors.values()), default=np.nan),
        max((e for f in done for e in f.tcp_errors.values()), default=np.nan),
        max((e for f in done for e in f.strays.values()), default=np.nan),
        max((f.late for f in done), default=np.nan),
        sum(bool(f.contacts) for f in done),
    )


def _goals(layout: Layout, count: int) -> Iterator[dict[str, list[float]]]:
    """Yield joint positions of all arms that a plan brings them to."""
    rng, found = np.random.default_rng(0), 0
    while found < count:
        goals = {arm: TcpGoal(_place(layout, arm, rng)) for arm in layout.arms}
        try:
            end = plan(layout, goals=goals, control_mode="pd_joint_pos")
        except NoPlanError:
            continue
        found += 1
        yield _arms(end)


def _place(layout: Layout, arm: str, rng: np.random.Generator) -> tuple[float, ...]:
    reach = layout.arm(arm).robot.reach
    x, y = (SPREAD * reach * rng.uniform(-1, 1, 2)).tolist()
    return x, y, reach * float(rng.uniform(*HEIGHTS))


def _arms(motion: Motion) -> dict[str, list[float]]:
    """Return where a motion brings the joints of each robot's arm."""
    found: dict[str, list[float]] = {}
    for name, placement in motion.layout.items():
        robot = placement.robot
        joints = [robot.joints.index(joint) for joint in robot.arm_joints]
        found[name] = motion.end[name][joints].tolist()
    return found


if __name__ == "__main__":
    start(main)
