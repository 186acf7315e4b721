"""What may overlap, as the collision groups by which SAPIEN tells it: pairs of links, and floors.

Two shapes collide if word 0 of one has a bit of word 1 of the other, unless their words 2 have a
bit in common and the lower halves of their words 3 are equal. So every link of a set in which any
two may overlap gets the same bit of word 2, and every robot of a world a word 3 of its own. Floors
and links that they let through have words 0 and 1 by which they collide with all but each other.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from robots import AssetError, RobotDescriptor
from robots.bodies.allowed import LinkPair, joined_pairs, read_allowed_pairs
from robots.bodies.overlaps import without_distant
from robots.urdf.model import UrdfModel

BITS = 32  # of word 2

# Words 0 and 1.
USUAL = (1, 1)
FLOOR = (1, 0)
NO_FLOOR_CONTACT = (3, 2)


def overlap_words(descriptor: RobotDescriptor, model: UrdfModel, urdf: Path) -> dict[str, int]:
    """Return word 2 of the links that may overlap others which PhysX does not let by itself.

    Args:
        descriptor: The robot, which says what its ``allowed_collisions`` are.
        model: What its URDF describes.
        urdf: That URDF.

    Raises:
        AssetError: If `BITS` bits are too few, or a mesh that is then looked at cannot be read.
        UnknownNameError: If ``allowed_collisions`` names a link that the URDF lacks.
    """
    solid = model.collisions.keys()
    allowed = {pair for pair in read_allowed_pairs(descriptor, model, urdf) if pair <= solid}
    joined = {pair for pair in joined_pairs(model) if pair <= solid}
    cliques = cover(allowed - joined, joined)
    if len(cliques) > BITS:
        cliques = cover(set(without_distant(allowed - joined, model, urdf)), allowed)
    if len(cliques) > BITS:
        raise AssetError(
            f"{descriptor.name}: SAPIEN keeps {BITS} groups of links that may all overlap each"
            f" other, and its allowed collisions take {len(cliques)}; allow fewer pairs, or all"
            " those of whole parts of the robot"
        )
    return common_bits(cliques)


def common_bits(sets: Iterable[set[str]]) -> dict[str, int]:
    """Return word 2 of the links of sets, in each of which any two may overlap: a bit for each."""
    words = dict[str, int]()
    for bit, links in enumerate(sets):
        for link in links:
            words[link] = words.get(link, 0) | 1 << bit
    return words


def cover(pairs: set[LinkPair], given: set[LinkPair]) -> list[set[str]]:
    """Return sets of links that hold all of some pairs, and no pair but these and some given.

    Each set is grown greedily, by the link that brings most pairs that no set holds yet.

    Args:
        pairs: Pairs that a set has to hold.
        given: Pairs that a set may hold.
    """
    partners: dict[str, set[str]] = {}
    for one, other in map(sorted, pairs | given):
        partners.setdefault(one, set()).add(other)
        partners.setdefault(other, set()).add(one)
    waiting, cliques = set(pairs), list[set[str]]()
    while waiting:
        clique = set(min(waiting, key=lambda pair: (_shared(pair, partners), sorted(pair))))
        while joining := set.intersection(*(partners[link] for link in clique)):
            gains = {link: _gain(link, clique, waiting) for link in sorted(joining)}
            best = max(gains, key=gains.__getitem__)
            if gains[best] == 0:
                break
            clique.add(best)
        waiting = {pair for pair in waiting if not pair <= clique}
        cliques.append(clique)
    return cliques


def _shared(pair: LinkPair, partners: dict[str, set[str]]) -> int:
    """Return how many links could join a pair; few leave little choice, so they come first."""
    return len(set.intersection(*(partners[link] for link in pair)))


def _gain(link: str, clique: set[str], waiting: set[LinkPair]) -> int:
    return sum(frozenset((link, other)) in waiting for other in clique)
