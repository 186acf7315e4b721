"""The SRDF of a cell: planning groups, grippers, postures, and pairs of links that may touch."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from xml.etree.ElementTree import Element, SubElement

from layouts.export.cell import ExportedCell, Standing
from layouts.export.ros2.groups import Group, Groups
from layouts.export.ros2.names import RosNames
from robots.bodies.allowed import joined_pairs, rigid_groups, rigid_pairs

HOME = "home"


def semantics(cell: ExportedCell, names: RosNames, groups: Groups, package: str) -> Element:
    """Return a cell's SRDF.

    The pairs of links that are left out of collision checks are those that `Layout.validate` leaves
    out, and no others. Within a robot they are those of its ``allowed_collisions`` (reason
    ``Default``), those that a joint joins (``Adjacent``), and those that never move against each
    other (``Never``); with a table they are links that stand still (``Never``).

    Args:
        cell: The cell.
        names: What everything is called.
        groups: Its planning groups.
        package: The package.
    """
    root = Element("robot", name=package)
    root.extend(_groups(names, groups))
    root.extend(_states(cell, names, groups))
    root.extend(_grippers(groups))
    for standing in cell.robots.values():
        root.extend(_allowed(standing, names))
    root.extend(_on_tables(cell, names))
    return root


def _groups(names: RosNames, groups: Groups) -> Iterator[Element]:
    for group in (*groups.own, *groups.made):
        made = Element("group", name=group.name)
        if group.chain is not None:
            first, last = group.chain
            SubElement(made, "chain", base_link=first, tip_link=last)
        else:
            for joint in group.joints:
                SubElement(made, "joint", name=names.joint(group.place, joint))
        for other in group.groups:
            SubElement(made, "group", name=other)
        yield made


def _states(cell: ExportedCell, names: RosNames, groups: Groups) -> Iterator[Element]:
    """Yield the posture that the layout starts from: of every group, all those within it."""
    own: dict[str, tuple[Group, ...]] = {group.name: (group,) for group in groups.own}
    for group in groups.made:
        own[group.name] = tuple(part for name in group.groups for part in own[name])
    for name, parts in own.items():
        state = Element("group_state", name=HOME, group=name)
        for part in parts:
            for joint in part.driven:
                value = repr(cell.robots[part.place].home[joint])
                SubElement(state, "joint", name=names.joint(part.place, joint), value=value)
        yield state


def _grippers(groups: Groups) -> Iterator[Element]:
    for group in groups.own:
        if group.carrier:
            end = {"name": f"{group.name}_end", "parent_link": group.carrier, "group": group.name}
            parent = {"parent_group": group.parent} if group.parent else {}
            yield Element("end_effector", {**end, **parent})


def _allowed(standing: Standing, names: RosNames) -> Iterator[Element]:
    model = standing.source.model
    joined, rigid = joined_pairs(model), rigid_pairs(model)
    for one, other in sorted(sorted(pair) for pair in standing.source.allowed):
        pair = frozenset((one, other))
        reason = "Adjacent" if pair in joined else "Never" if pair in rigid else "Default"
        yield _pair(names.link(standing.place, one), names.link(standing.place, other), reason)


def _on_tables(cell: ExportedCell, names: RosNames) -> Iterator[Element]:
    for table, standing in product(cell.tables, cell.robots.values()):
        model = standing.source.model
        for link in rigid_groups(model)[model.root]:
            if link in model.collisions:
                yield _pair(names.frames[table], names.link(standing.place, link), "Never")


def _pair(one: str, other: str, reason: str) -> Element:
    return Element("disable_collisions", link1=one, link2=other, reason=reason)
