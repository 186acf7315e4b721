"""Distances that presets choose: whichever robots of the catalogue stand there, they keep clear."""

import itertools
import random
from collections.abc import Callable, Sequence

import pytest

from layouts import Layout, around_table, grid, ring, side_by_side
from tasks.originals.relay import find_zones

CLEAR = 0.05  # m, at the keyframes with joint noise
# What two panda_wristcam that look at each other have at native's distance.
CLEAR_IN_NATIVE = 0.03
LOOKING = ("panda_wristcam", "panda_wristcam")

WAYS: dict[str, Callable[[dict[str, str]], Layout]] = {
    "row": lambda robots: side_by_side(robots, spacing="auto"),
    "ring": ring,
    "ring along": lambda robots: ring(robots, facing="tangent"),
    "grid": grid,
    "table": around_table,
    "corner": lambda robots: around_table(
        robots, edges=[("south", "east", "east")[i % 3] for i in range(len(robots))]
    ),
}


ROBOTS = ("fetch", "floating_panda_gripper", "koch", "mobile_panda", "panda", "panda_pinch",
          "panda_stick", "panda_wristcam", "so100", "xarm7")  # fmt: skip


def clearance(way: Callable[[dict[str, str]], Layout], mix: Sequence[str]) -> float:
    """Return the least distance of any two robots, with joint noise (m)."""
    layout = way({f"arm_{i}": robot for i, robot in enumerate(mix)})
    clearances = layout.validate(workspaces=False, samples=10).clearances
    return min(between.noisy_distance for between in clearances if not between.table)


def mixes(count: int, seed: int) -> list[list[str]]:
    """Draw some mixes of three to five robots."""
    draw = random.Random(seed)
    return [draw.choices(ROBOTS, k=draw.randint(3, 5)) for _ in range(count)]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    "mix",
    [
        ("panda", "panda_stick", "so100"),
        ("panda", "so100", "panda_stick"),
        ("panda",) * 4,
        ("panda_stick", "fetch", "koch", "fetch"),
        ("fetch", "koch", "koch", "fetch"),
        *mixes(3, seed=0),
    ],
    ids="-".join,
)
def test_robots_keep_clear(way, mix):
    assert clearance(WAYS[way], mix) >= CLEAR


@pytest.mark.long
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("first", ROBOTS)
def test_any_two_and_three_keep_clear(way, first):
    names = ROBOTS
    for mix in [*itertools.product([first], names), *itertools.product([first], names, names)]:
        looking = mix[:2] == LOOKING and way in ("ring", "table")
        assert clearance(WAYS[way], mix) >= (CLEAR_IN_NATIVE if looking else CLEAR), mix


@pytest.mark.parametrize("mix", [*itertools.product(("panda", "koch", "fetch"), repeat=3)])
def test_in_a_ring_a_relay_finds_a_place_between_any_two(mix):
    assert len(find_zones(ring({f"arm_{i}": robot for i, robot in enumerate(mix)}))) == 3
