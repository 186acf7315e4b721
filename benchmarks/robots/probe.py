"""Tries one robot in this process: ``python -m benchmarks.robots.probe URDF`` (or an MJCF).

Prints a line of JSON for each thing that it tried, so that what was seen before a crash is kept.
A robot is refused where an error of this library says why; any other exception is ``raw``.
"""

from __future__ import annotations

import json
import math
import resource
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from layouts import Layout, Placement, face_to_face, side_by_side, single
from layouts.validation.collisions import nearest
from layouts.validation.collisions import stand as stand_hulls
from robot_layouts.experts import find_expert
from robot_layouts.kinematics.rotations import Floats, inverse_pose
from robot_layouts.simulation import PhysicsSettings
from robot_layouts.simulation.checks.grasp import try_grasps
from robot_layouts.simulation.checks.overlaps import empty, stand
from robot_layouts.simulation.checks.tcp_control import try_tcp_control
from robot_layouts.simulation.checks.trial import tcp_error, try_robot
from robot_layouts.simulation.simulation import Simulation
from robots import RobotDescriptor, RobotLayoutsError, TaskError
from robots.bodies.hulls import RobotModel, load_model
from robots.bodies.overlaps import overlapping
from robots.from_urdf import guess_descriptor
from robots.mjcf.conversion import convert, locate
from robots.mjcf.couplings import find_couplings
from robots.mjcf.reading import compiled, mujoco, read_mjcf
from robots.mjcf.robot import find_robot
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from robots.urdf.tree import kinematic_tree
from tasks import make
from tasks.episode import play

MEMORY = 8 << 30  # bytes of this process
STEPS = 500
LARGEST = 1e9  # of a number in the record, which has no infinity
POSTURES = {"overlaps": 200, "kinematics": 100}  # random ones
TOUCH = 1e-3  # m; overlaps that are less deep do not count
TIMESTEP = 1e-5  # s, in which nothing moves
WIDEST = 3.0  # rad or m from 0
HAND_OVER = "TwoRobotHandOver-v1"
SEEDS, SOLVED = 10, 8  # episodes of it, and how many are to be solved
NAME = "robot"

Seen = dict[str, Any]


def main() -> int:
    """Try the file of the command line, thing by thing."""
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, resource.RLIM_INFINITY))
    path, robots = Path(sys.argv[1]).absolute(), list[RobotDescriptor]()
    _tell("loads", lambda: _loads(path, robots))
    for robot in robots:
        if path.suffix == ".xml":
            _tell("kinematics", lambda: {"difference": kinematic_difference(path)})
        for what, look in (MJCF_LOOKS if path.suffix == ".xml" else LOOKS).items():
            _tell(what, partial(look, robot))
    return 0


def _tell(what: str, run: Callable[[], Seen]) -> None:
    """Print what something found, or how it failed."""
    try:
        seen = run()
    except RobotLayoutsError as error:
        seen = {"refused": str(error)}
    except Exception as error:  # what must not happen is what is looked for
        seen = {"raw": f"{type(error).__name__}: {error}"}
    print(json.dumps({what: seen}), flush=True)


def _loads(path: Path, robots: list[RobotDescriptor]) -> Seen:
    """Return what is guessed of a robot, and add its descriptor to a list."""
    robot = guess_descriptor(path).descriptor
    robots.append(robot)
    return {
        "groups": {
            name: {"joints": list(group.joints), "numbers": group.size}
            for name, group in robot.action_split.groups.items()
        },
        "tcp": robot.tcp_link,
        "tips": list(robot.tcp_position_links),
        "tcp_offset": list(robot.tcp_offset),
        "reach": round(robot.reach, 4),
    }


def _valid(layout: Layout) -> Seen:
    report = layout.validate(workspaces=False)
    serious = [finding.what for finding in report.findings if finding.serious]
    return {"ok": report.ok, "why": serious[:1]}


def _tcp_move(robot: RobotDescriptor) -> Seen:
    """Return how far the TCP stayed from where inverse kinematics was to bring it (m)."""
    error = tcp_error(robot)
    return {"error": None if error is None else _rounded(error)}


def _trial(robot: RobotDescriptor) -> Seen:
    """Try a robot in physics, and return what was seen in numbers."""
    seen = try_robot(robot, STEPS)
    return {
        "first_step": _rounded(seen.first_step.amount),
        "after_hold": _rounded(seen.after_hold.amount),
        "stands": seen.stands,
        "fastest": _rounded(seen.fastest.times),
        "exploded": None if seen.exploded is None else seen.exploded.step,
        "numbers": len(seen.numbers),
        "wrong_numbers": [n.number.name for n in seen.numbers if n.problem is not None],
        "problems": list(seen.problems[:4]),
    }


def _grasps(robot: RobotDescriptor) -> Seen:
    """Close every gripper on a cube in physics, and shake it."""
    return {
        "grippers": [
            {
                "fingers": seen.fingers is not None,
                "tcp_off": _rounded(seen.tcp_off),
                "grasps": seen.grasps,
                "problem": seen.problem,
            }
            for seen in try_grasps(robot)
        ]
    }


def _tcp_control(robot: RobotDescriptor) -> Seen:
    """Hold every TCP, and send it along a square, in each mode that steers it."""
    trials = list(try_tcp_control(robot)) if robot.arm_joints else []
    return {
        "trials": [
            {
                "arm": seen.arm,
                "mode": seen.mode,
                "drift": _rounded(seen.drift),
                "corner": _rounded(seen.corner),
                "reported": _rounded(seen.reported),
                "problem": seen.problem,
            }
            for seen in trials
        ]
    }


def _hand_over(robot: RobotDescriptor) -> Seen:
    """Let the expert hand a cube over, from one of two such robots to the other, or on one body.

    Seeds are played until it is known whether 8 of 10 are solved.
    """
    alone = single({NAME: robot})
    hands = [arm for arm in alone.places if alone.arm(arm).robot.fingers is not None]
    if not hands:
        return {"hands": 0}
    if len(hands) > 1:
        task = make(HAND_OVER, robots=robot, obs_mode="none")
    else:
        layout = face_to_face({"left": robot, "right": robot})
        task = make(HAND_OVER, layout=layout, obs_mode="none")
    solved, why = 0, list[str]()
    expert = find_expert(HAND_OVER)
    with closing(task):
        for seed in range(SEEDS):
            try:
                plan = expert(task, seed)
            except TaskError as error:
                why.append(str(error))
            else:
                if play(task, seed, plan).solved:
                    solved += 1
                else:
                    why.append(getattr(plan, "reason", ""))
            if solved == SOLVED or len(why) > SEEDS - SOLVED:
                break
    return {"hands": len(hands), "solved": solved, "of": solved + len(why), "why": why[:1]}


def _exported_urdf(robot: RobotDescriptor) -> Seen:
    """Save a robot as a URDF, read that again, and look for its meshes."""
    with tempfile.TemporaryDirectory() as folder:
        path = single({NAME: robot}).to_urdf(Path(folder) / "robot.urdf", visuals=False)
        model = read_model(read_urdf(path), path.as_posix())
        joints = {joint.name for joint in model.moving}
        meshes = [s.file for shapes in model.collisions.values() for s in shapes if s.file]
        missing = [mesh for mesh in meshes if not Path(mesh).is_file()]
        wanted = {f"{NAME}/{joint}" for joint in robot.joints}
        return {"ok": joints == wanted and not missing, "missing": missing}


def _exported_drake(robot: RobotDescriptor) -> Seen:
    """Save a robot for Drake, and read its URDF and its start again."""
    with tempfile.TemporaryDirectory() as folder:
        path = single({NAME: robot}).to_drake(Path(folder) / "robot.dmd.yaml", visuals=False)
        text = path.read_text().replace("!Rpy", "")  # a tag that rotations have
        model = yaml.safe_load(text)["directives"][0]["add_model"]
        urdf = Path(model["file"].removeprefix("file://"))
        moving = {joint.name for joint in read_model(read_urdf(urdf), urdf.as_posix()).moving}
        return {"ok": set(model["default_joint_positions"]) <= moving == set(robot.joints)}


def _agreement(robot: RobotDescriptor) -> Seen:
    """Count pairs of links inside each other: for checks and physics, and for one alone.

    Both make convex bodies of the same shapes. PhysX makes its own with fewer corners, up to 3 mm
    inside, and where two edges cross it may report an overlap too shallow, or none.
    """
    model = load_model(robot)
    low, high = np.clip(model.kinematics.limits, -WIDEST, WIDEST).T
    drawn = np.random.default_rng(1).uniform(low, high, (POSTURES["overlaps"], len(low)))
    both = physics = checks = 0
    for qpos, seen in zip(drawn, _in_physics(robot, drawn), strict=True):
        found = _in_checks(model, qpos)
        both += len(found.keys() & seen.keys())
        physics += sum(seen[pair] > TOUCH for pair in seen.keys() - found.keys())
        for pair in found.keys() - seen.keys():
            standing = stand_hulls(NAME, Placement(robot).base_pose, model, qpos[None])
            approach = nearest(standing, standing, found[pair])
            checks += approach is not None and -approach.distance > TOUCH
    return {"both": both, "physics": physics, "checks": checks}


def _in_physics(robot: RobotDescriptor, drawn: Floats) -> Iterator[dict[frozenset[str], float]]:
    """Yield the overlaps of links in each posture, and how deep they are (m)."""
    simulation = Simulation(
        single({NAME: robot}),
        empty,
        1,
        PhysicsSettings(timestep=TIMESTEP),
        control_frequency=1 / TIMESTEP,
    )
    stand(simulation)
    still = np.zeros((1, robot.action_dim), np.float32)
    for qpos in drawn:
        simulation.worlds[0].stand(NAME, qpos)
        simulation.touched()
        simulation.step(still, simulation.read().joint_positions)
        overlaps = simulation.backend.overlaps(0)
        yield {frozenset((lap.one.name, lap.other.name)): lap.depth for lap in overlaps}


def _in_checks(model: RobotModel, qpos: Floats) -> dict[frozenset[str], list[tuple[int, int]]]:
    """Return the overlaps of links in a posture, each with the hulls that overlap."""
    poses = model.kinematics.forward(qpos[None])[0]
    found: dict[frozenset[str], list[tuple[int, int]]] = {}
    hits = overlapping(model.hulls, poses, model.self_pairs)
    for pair, hit in zip(model.self_pairs, hits, strict=True):
        if hit:
            found.setdefault(frozenset(map(model.link_name, pair)), []).append(pair)
    return found


def kinematic_difference(path: Path, postures: int = POSTURES["kinematics"]) -> float:
    """Return by how much the URDF that is made of an MJCF moves otherwise than MuJoCo moves it.

    Each joint stands anywhere within its limits, also those that follow others. Compared is every
    entry of the bodies' pose matrices, seen from the first body: places (m), and the axes'
    directions.

    Args:
        path: The MJCF.
        postures: How many.

    Raises:
        RobotLayoutsError: If it cannot be converted.
    """
    model, _ = compiled(read_mjcf(path), path)
    robot, urdf, frames = find_robot(model, path), locate(path), convert(path).frames
    fixed = find_couplings(robot, path).fixed
    tree = kinematic_tree(read_model(read_urdf(urdf), urdf.as_posix()))
    generator, data, largest = np.random.default_rng(0), mujoco().MjData(model), 0.0
    for _ in range(postures):
        qpos = np.zeros(len(tree.coordinates))
        data.qpos[:] = model.qpos0
        for joint, name in robot.names.items():
            limited, span = model.jnt_limited[joint], model.jnt_range[joint].tolist()
            low, high = span if limited else (-math.pi, math.pi)
            at = fixed.get(joint, generator.uniform(low, high))
            data.qpos[model.jnt_qposadr[joint]] = at
            if joint not in fixed:
                qpos[tree.coordinates.index(name)] = at
        mujoco().mj_kinematics(model, data)
        poses = tree.forward(qpos[None])[0]
        ours, theirs = list[Floats](), list[Floats]()
        for body in robot.bodies:
            link = robot.links[body]
            ours.append(poses[tree.link(link)] @ frames[link])
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
            theirs.append(pose)
        one, other = (inverse_pose(side[0]) @ np.array(side) for side in (ours, theirs))
        largest = max(largest, float(np.abs(one - other).max()))
    return largest


Looks = Mapping[str, Callable[[RobotDescriptor], Seen]]

MJCF_LOOKS: Looks = {
    "alone": lambda robot: _valid(single({NAME: robot})),
    "trial": _trial,
    "tcp_move": _tcp_move,
}
LOOKS: Looks = {
    "alone": MJCF_LOOKS["alone"],
    "facing": lambda robot: _valid(face_to_face({"a": robot, "b": robot}, spacing="auto")),
    "beside": lambda robot: _valid(
        side_by_side({NAME: robot, "neighbour": "panda"}, spacing="auto")
    ),
    "trial": _trial,
    "tcp_move": _tcp_move,
    "agreement": _agreement,
    "to_urdf": _exported_urdf,
    "to_drake": _exported_drake,
    "grasps": _grasps,
    "tcp_control": _tcp_control,
    "hand_over": _hand_over,
}


def _rounded(value: float) -> float:
    return float(f"{min(value, LARGEST):.3g}")


if __name__ == "__main__":
    sys.exit(main())
