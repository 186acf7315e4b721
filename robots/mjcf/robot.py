"""Which bodies and joints of an MJCF are the robot, and what they are called."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from robots.common.errors import AssetError, DescriptorError
from robots.mjcf.compiling import Model, name_of

FREE, BALL, SLIDE, HINGE = range(4)  # MuJoCo's types of joints
JOINT, JOINT_IN_PARENT, TENDON = 0, 1, 3  # of what actuators drive; MuJoCo's numbers
LOCKED = 1e6  # N·s/m, N·m·s/rad; a joint that is damped so much does not move
LISTED = 6  # names in a message


@dataclass(frozen=True, eq=False)
class MjcfRobot:
    """The part of a model that is the robot.

    Attributes:
        model: MuJoCo's model.
        roots: Bodies on the ground, each with a tree of its own.
        bodies: All its bodies, each after its parent.
        joints: Joints of each body that move, in MuJoCo's order.
        links: Link names by body.
        names: Joint names by joint.
        notes: What was left out and why, one sentence each.
    """

    model: Model
    roots: tuple[int, ...]
    bodies: tuple[int, ...]
    joints: dict[int, tuple[int, ...]]
    links: dict[int, str]
    names: dict[int, str]
    notes: tuple[str, ...]

    @property
    def moving(self) -> tuple[int, ...]:
        """All joints that move, in MuJoCo's order."""
        return tuple(joint for body in self.bodies for joint in self.joints[body])


def find_robot(model: Model, path: Path) -> MjcfRobot:
    """Tell the robot from what stands around it.

    Args:
        model: MuJoCo's model.
        path: The MJCF, for messages.

    Raises:
        AssetError: If it has a ball joint behind another joint.
        DescriptorError: If nothing of it is a robot.
    """
    trees = {root: _below(model, root) for root in range(1, model.nbody) if _on_ground(model, root)}
    jointed = {root: tree for root, tree in trees.items() if any(_turning(model, b) for b in tree)}
    if not jointed:
        raise DescriptorError(
            f"{path} has no joint that turns or slides; there is nothing to drive"
        )
    driven = _driven(model)
    actuated = {r: tree for r, tree in jointed.items() if driven & _joints_of(model, tree)}
    chosen = actuated or jointed
    notes = [*_left_out(model, trees, jointed, chosen)]
    bodies = tuple(sorted(body for tree in chosen.values() for body in tree))
    joints: dict[int, tuple[int, ...]] = {}
    for body in bodies:
        joints[body], remarks = _moving(model, body, path)
        notes += remarks
    links = _unique((body, name_of(model, "body", body) or f"body{body}") for body in bodies)
    named = _unique(
        (joint, name_of(model, "joint", joint) or f"{links[body]}_joint")
        for body in bodies
        for joint in joints[body]
    )
    return MjcfRobot(model, tuple(chosen), bodies, joints, links, named, tuple(notes))


def _on_ground(model: Model, body: int) -> bool:
    return int(model.body_parentid[body]) == 0


def _below(model: Model, root: int) -> tuple[int, ...]:
    """Return a body and all that it carries; MuJoCo has every body after its parent."""
    found = {root}
    for body in range(root + 1, model.nbody):
        if int(model.body_parentid[body]) in found:
            found.add(body)
    return tuple(sorted(found))


def _all_joints(model: Model, body: int) -> range:
    first = int(model.body_jntadr[body])
    return range(first, first + int(model.body_jntnum[body]))


def _turning(model: Model, body: int) -> bool:
    return any(model.jnt_type[joint] in (SLIDE, HINGE) for joint in _all_joints(model, body))


def _joints_of(model: Model, bodies: Sequence[int]) -> set[int]:
    return {joint for body in bodies for joint in _all_joints(model, body)}


def _driven(model: Model) -> set[int]:
    """Return the joints that an actuator drives, also by a tendon."""
    found: set[int] = set()
    for actuator in range(model.nu):
        target = int(model.actuator_trnid[actuator, 0])
        if model.actuator_trntype[actuator] in (JOINT, JOINT_IN_PARENT):
            found.add(target)
        elif model.actuator_trntype[actuator] == TENDON:
            found |= {joint for joint, _ in tendon_joints(model, target)}
    return found


def tendon_joints(model: Model, tendon: int) -> list[tuple[int, float]]:
    """Return the joints of a fixed tendon and their coefficients; none of a spatial one."""
    first = int(model.tendon_adr[tendon])
    wraps = range(first, first + int(model.tendon_num[tendon]))
    return [
        (int(model.wrap_objid[i]), float(model.wrap_prm[i]))
        for i in wraps
        if int(model.wrap_type[i]) == 1  # mjWRAP_JOINT
    ]


def _left_out(
    model: Model,
    trees: dict[int, tuple[int, ...]],
    jointed: dict[int, tuple[int, ...]],
    chosen: dict[int, tuple[int, ...]],
) -> Iterator[str]:
    """Yield what is no part of the robot."""
    still = [root for root in trees if root not in jointed]
    idle = [root for root in jointed if root not in chosen]
    if still:
        yield f"left out: {_listing(model, still)}, in which no joint turns or slides"
    if idle:
        yield f"left out: {_listing(model, idle)}, of which no actuator drives a joint"
    ground = int(model.body_geomnum[0])
    if ground:
        yield f"left out: what stands on the ground without a body, {ground} shapes"


def _moving(model: Model, body: int, path: Path) -> tuple[tuple[int, ...], list[str]]:
    """Return the joints of a body that move, and remarks on the others.

    Raises:
        AssetError: If there is a ball joint among them.
    """
    moving: list[int] = []
    notes: list[str] = []
    for joint in _all_joints(model, body):
        kind = int(model.jnt_type[joint])
        name = name_of(model, "joint", joint) or name_of(model, "body", body)
        if kind == FREE or (kind == BALL and _on_ground(model, body)):
            what = "flies freely" if kind == FREE else "turns on a ball joint"
            notes.append(
                f"joint {name!r}, by which the whole robot {what}, is fixed: a layout says where it"
                " stands"
            )
        elif kind == BALL:
            raise AssetError(
                f"{path}: joint {name!r} is a ball joint; only hinges and slides can be driven:"
                " three hinges in a row move as it does"
            )
        elif float(model.dof_damping[model.jnt_dofadr[joint]]) >= LOCKED:
            damping = float(model.dof_damping[model.jnt_dofadr[joint]])
            notes.append(f"joint {name!r} is fixed, as a damping of {damping:g} keeps it still")
        else:
            moving.append(joint)
    return tuple(moving), notes


def _listing(model: Model, bodies: Sequence[int]) -> str:
    names = [name_of(model, "body", body) or f"body{body}" for body in bodies]
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return ", ".join(names[:LISTED]) + more


def _unique(given: Iterator[tuple[int, str]]) -> dict[int, str]:
    """Return names by index, each with a number where it is taken."""
    names: dict[int, str] = {}
    taken: set[str] = set()
    for index, name in given:
        free, count = name, 2
        while free in taken:
            free, count = f"{name}_{count}", count + 1
        taken.add(free)
        names[index] = free
    return names
