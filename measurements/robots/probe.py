"""Tries one URDF in this process: ``python -m measurements.robots.probe URDF``.

Prints a line of JSON for each thing that it tried, so that what was seen before a crash is kept.
A robot is refused where an error of this library says why; any other exception is ``raw``.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from layouts import Layout, face_to_face, side_by_side, single
from measurements.robots.agreement import compare
from robots import RobotDescriptor, RobotLayoutsError
from robots.from_urdf import guess_descriptor
from robots.urdf.reading import read_model
from robots.urdf.summary import read_urdf
from simulation.checks.trial import NumberTrial, tcp_error, try_robot

STEPS = 500
NEIGHBOUR = "panda"
LARGEST = 1e9  # of a number in the record, which has no infinity

Seen = dict[str, Any]


def main() -> int:
    """Try the URDF of the command line, thing by thing."""
    robots: list[RobotDescriptor] = []
    tell("loads", lambda: loads(Path(sys.argv[1]), robots))
    for robot in robots:
        for what, look in LOOKS.items():
            tell(what, partial(look, robot))
    return 0


def tell(what: str, run: Callable[[], Seen]) -> None:
    """Print what came of something, or how it failed."""
    try:
        seen = run()
    except RobotLayoutsError as error:
        seen = {"refused": str(error)}
    except Exception as error:  # what must not happen is what is looked for
        seen = {"raw": f"{type(error).__name__}: {error}"}
    print(json.dumps({what: seen}), flush=True)


def loads(urdf: Path, robots: list[RobotDescriptor]) -> Seen:
    """Return what is guessed of a robot, and add its descriptor to a list."""
    robot = guess_descriptor(urdf).descriptor
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


def valid(layout: Layout) -> Seen:
    """Return whether a layout passes its check, and what was found if not."""
    report = layout.validate(workspaces=False)
    serious = [finding.what for finding in report.findings if finding.serious]
    return {"ok": report.ok, "why": serious[:1]}


def tcp_move(robot: RobotDescriptor) -> Seen:
    """Return how far the TCP stayed from where inverse kinematics was to bring it (m)."""
    error = tcp_error(robot)
    return {"error": None if error is None else _rounded(error)}


def facing(robot: RobotDescriptor) -> Seen:
    """Return whether two of a robot may look at each other."""
    return valid(face_to_face({"a": robot, "b": robot}, spacing="auto"))


def beside(robot: RobotDescriptor) -> Seen:
    """Return whether a robot may stand beside a Panda."""
    return valid(side_by_side({"robot": robot, "neighbour": NEIGHBOUR}, spacing="auto"))


def trial(robot: RobotDescriptor) -> Seen:
    """Try a robot, and return what was seen in numbers."""
    seen = try_robot(robot, STEPS)
    return {
        "first_step": _rounded(seen.first_step.amount),
        "after_hold": _rounded(seen.after_hold.amount),
        "stands": seen.stands,
        "fastest": _rounded(seen.fastest.times),
        "exploded": None if seen.exploded is None else seen.exploded.step,
        "numbers": len(seen.numbers),
        "wrong_numbers": [number for one in seen.numbers for number in _wrong(one)],
        "problems": list(seen.problems[:4]),
    }


def agreement(robot: RobotDescriptor) -> Seen:
    """Return in how many cases checks and physics see links inside each other, or one alone."""
    return compare(robot)._asdict()


def exported_urdf(robot: RobotDescriptor) -> Seen:
    """Save a robot as a URDF, read that again, and look for its meshes."""
    with tempfile.TemporaryDirectory() as folder:
        path = single({"robot": robot}).to_urdf(Path(folder) / "robot.urdf", visuals=False)
        model = read_model(read_urdf(path), path.as_posix())
        joints = {joint.name for joint in model.moving}
        meshes = [s.file for shapes in model.collisions.values() for s in shapes if s.file]
        missing = [mesh for mesh in meshes if not Path(mesh).is_file()]
        return {
            "ok": joints == {f"robot/{joint}" for joint in robot.joints} and not missing,
            "missing": missing,
        }


def exported_drake(robot: RobotDescriptor) -> Seen:
    """Save a robot for Drake, and read its URDF and its start again."""
    with tempfile.TemporaryDirectory() as folder:
        path = single({"robot": robot}).to_drake(Path(folder) / "robot.dmd.yaml", visuals=False)
        model = yaml.load(path.read_text(), Loader=_Directives)["directives"][0]["add_model"]
        urdf = Path(model["file"].removeprefix("file://"))
        moving = {joint.name for joint in read_model(read_urdf(urdf), urdf.as_posix()).moving}
        return {"ok": set(model["default_joint_positions"]) <= moving == set(robot.joints)}


LOOKS: Mapping[str, Callable[[RobotDescriptor], Seen]] = {
    "alone": lambda robot: valid(single({"robot": robot})),
    "facing": facing,
    "beside": beside,
    "trial": trial,
    "tcp_move": tcp_move,
    "agreement": agreement,
    "to_urdf": exported_urdf,
    "to_drake": exported_drake,
}


class _Directives(yaml.SafeLoader):
    """Reads directives of Drake, in which rotations have a tag."""


def _mapping(loader: Any, node: Any) -> Any:
    return loader.construct_mapping(node, deep=True)


_Directives.add_constructor("!Rpy", _mapping)


def _wrong(number: NumberTrial) -> Iterator[str]:
    if number.problem is not None:
        yield number.number.name


def _rounded(value: float) -> float:
    return float(f"{min(value, LARGEST):.3g}")


if __name__ == "__main__":
    sys.exit(main())
