"""Batched checks of collisions answer what FCL alone answers, and say who is too near to whom."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layouts import Layout, Placement, face_to_face
from layouts.validation.collisions import FAR
from robot_layouts.motion.collision.cell import Cell
from robot_layouts.motion.collision.travel import TravelBounds
from robot_layouts.motion.model.bodies import WORLD
from robot_layouts.motion.model.obstacles import Track, box
from robots import LayoutError, UnknownNameError
from tests.layouts.small_robots import joint, link, robot, urdf
from tests.motion import cells

UPTURNED = np.array([0.0, 0.0, 0.0, -0.1, 0.0, 2.0, 0.8, 0.04, 0.04])  # a Panda that reaches up


@pytest.fixture(scope="module")
def crowd() -> Cell:
    return cells.crowded()


@pytest.fixture(scope="module")
def drive() -> Cell:
    return cells.driving()


@pytest.fixture(params=["crowded", "pandas", "guessed", "driving", "dual"])
def cell(request, tmp_path):
    if request.param == "dual":
        from tests.catalogue import optional_problem

        if problem := optional_problem():
            pytest.skip(problem)
    make = getattr(cells, request.param)
    return make(tmp_path) if request.param == "guessed" else make()


def test_free_is_what_fcl_alone_says(cell):
    qpos, times = cells.states(cell, 12)
    apart = cells.least_distances(cell.checker(), qpos, times)
    for clearance in (0.0, 0.03):
        checker = cell.checker(clearance=clearance)
        bad = (apart < checker.apart) | (apart == 0.0)
        free = checker.free(qpos, times)
        assert free.tolist() == (~bad.any(axis=1)).tolist()
        for i in range(0, 12, 3):
            assert checker.close(qpos[i], times[i]).tolist() == bad[i].tolist()
            assert checker.free(qpos[i : i + 1], times[i]).tolist() == [bool(free[i])]


def test_distance_is_the_least_that_fcl_finds(cell):
    checker = cell.checker(own=None)
    qpos, times = cells.states(cell, 6, seed=1)
    least = cells.least_distances(checker, qpos, times).min(axis=1)
    distance = checker.distance(qpos, times)
    np.testing.assert_allclose(np.maximum(distance, 0.0), least, atol=1e-6)
    for state, time, known in zip(qpos[:4], times[:4], distance[:4], strict=True):
        assert checker.nearest(state, time).distance == pytest.approx(known, abs=1e-6)


# -- who and how near ------------------------------------------------------------------------


def boxes_apart(gap: float) -> Cell:
    """A Panda, and a box above its upturned hand."""
    bare = Cell(Layout({"arm": Placement("panda")}))
    tops = [
        (pose @ [*corner, 1.0])[2]
        for solid, pose in zip(
            bare.solids, cells.solid_poses(bare, UPTURNED[None], None)[0], strict=True
        )
        for corner in solid.hull.corners
    ]
    return Cell(bare.layout, [box("lid", (2.0, 2.0, 0.1), (0.0, 0.0, max(tops) + gap + 0.05))])


@pytest.mark.parametrize("gap", [0.004, 0.02])
def test_a_clearance_is_kept_to_the_tenth_of_a_millimetre(gap):
    cell = boxes_apart(gap)
    assert cell.checker(own=None).distance(UPTURNED[None])[0] == pytest.approx(gap, abs=1e-6)
    assert cell.checker(clearance=gap - 1e-4).free(UPTURNED[None])[0]
    close = cell.checker(clearance=gap + 1e-4)
    assert not close.free(UPTURNED[None])[0]
    contact = close.contact(UPTURNED)
    assert contact.owners == ("arm", "lid")
    assert contact.distance == pytest.approx(gap, abs=1e-6)
    assert str(contact).startswith(f"{contact.names[0]} comes within")


def test_an_overlap_has_a_depth():
    contact = boxes_apart(-0.01).checker().contact(UPTURNED)
    assert contact.names[1] == "lid"
    assert contact.distance == pytest.approx(-0.01, abs=1e-6)
    assert str(contact) == f"{contact.names[0]} and lid overlap by 1.0 cm"


def test_own_links_keep_their_own_distance(crowd):
    own = {"own": 0.05, "moving": ["left"]}
    apart = crowd.checker(clearance=0.2, **own)
    movers = [[crowd.solids[i].mover for i in pair] for pair in apart.pairs.tolist()]
    assert {d for (a, b), d in zip(movers, apart.apart.tolist(), strict=True) if a == b} == {0.05}
    assert {d for (a, b), d in zip(movers, apart.apart.tolist(), strict=True) if a != b} == {0.2}
    none = crowd.checker(own=None)
    assert all(crowd.solids[a].mover != crowd.solids[b].mover for a, b in none.pairs.tolist())


def test_nothing_within_reach_is_far():
    cell = Cell(face_to_face({"one": "panda", "other": "panda"}, spacing=30.0))
    checker = cell.checker(own=None)
    assert checker.distance(cell.start[None]).tolist() == [FAR]
    assert checker.nearest(cell.start) is None
    assert checker.contact(cell.start) is None


# -- which pairs count -----------------------------------------------------------------------


def test_only_pairs_of_those_that_move_are_looked_at(crowd):
    checker = crowd.checker(moving=["small"])
    names = {
        frozenset((crowd.solids[a].owner, crowd.solids[b].owner)) for a, b in checker.pairs.tolist()
    }
    others = {"left", "right", "stick", "table", "crate", "ball", "post", "cart", "small"}
    assert names == {frozenset(("small", other)) for other in others}
    parts = {frozenset(p) for p in np.array([s.part for s in crowd.solids])[checker.pairs].tolist()}
    assert all(len(pair) == 2 for pair in parts)  # what is rigid with each other never counts


def test_what_is_held_may_touch_its_hand_and_nothing_else(crowd):
    stick = {
        crowd.solids[a].name if crowd.solids[b].owner == "stick" else crowd.solids[b].name
        for a, b in crowd.counted_pairs
        if "stick" in (crowd.solids[a].owner, crowd.solids[b].owner)
    }
    hand = {f"left/panda_{link}" for link in ("link7", "hand", "leftfinger", "rightfinger")}
    assert not stick & hand
    assert {"left/panda_link5", "right/panda_hand", "table", "crate", "cart"} <= stick


def test_what_is_held_collides_where_its_arm_takes_it():
    bare = cells.pandas(1)
    hand = bare.poses(bare.start[None])[0, bare.links.index(("arm_0", "panda_hand_tcp"))]
    ahead, farther = hand.copy(), hand.copy()
    ahead[:3, 3] += 0.25 * hand[:3, 2]
    farther[:3, 3] += 0.5 * hand[:3, 2]
    stone = box("stone", (0.1, 0.1, 0.1)).moved(farther)
    free = Cell(bare.layout, [stone])
    rod = box("rod", (0.02, 0.02, 0.5)).moved(ahead)
    assert free.checker().free(bare.start[None])[0]
    held = Cell(bare.layout, [stone], [bare.grasped("arm_0", rod)])
    assert held.checker().contact(bare.start).names == ("stone", "rod")
    assert held.checker(except_=[("rod", "stone")]).free(bare.start[None])[0]
    assert not held.checker(except_=[("rod", "arm_0/panda_hand")]).free(bare.start[None])[0]


def test_what_moves_is_where_its_time_says():
    cell = boxes_apart(0.02)
    down = cell.obstacles[0].pose.copy()
    down[2, 3] -= 0.04
    lid = cell.obstacles[0].moved(
        Track(np.array([0.0, 2.0]), np.stack([cell.obstacles[0].pose, down]))
    )
    checker = Cell(cell.layout, [lid]).checker()
    times = np.array([0.0, 0.9, 1.1, 5.0])
    free = checker.free(np.tile(UPTURNED, (4, 1)), times)
    assert free.tolist() == [True, True, False, False]
    assert checker.free(UPTURNED[None]).tolist() == [True]
    assert checker.contact(UPTURNED, 5.0).distance == pytest.approx(-0.02, abs=1e-6)
    assert checker.edge_free(UPTURNED, UPTURNED, times=(0.0, 0.9))
    assert not checker.edge_free(UPTURNED, UPTURNED, times=(0.0, 1.1))
    assert not checker.edge_free(UPTURNED, UPTURNED, times=(5.0, 6.0))


# -- edges -----------------------------------------------------------------------------------


def an_edge(cell, seed):
    """Return a way from somewhere to somewhere not far from there; slides go out by metres."""
    random = np.random.default_rng(seed)
    low, high = np.clip(cell.limits, -3.0, 3.0).T
    a = random.uniform(low, high)
    return cell, a, np.clip(a + random.normal(0, 0.3, cell.size), low, high)


@pytest.mark.parametrize("name", ["crowd", "drive"])
@given(seed=st.integers(0, 1000), way=st.sampled_from([0.005, 0.05]))
@settings(max_examples=12)
def test_no_corner_travels_farther_than_the_resolution(crowd, drive, name, seed, way):
    cell, a, b = an_edge({"crowd": crowd, "drive": drive}[name], seed)
    steps = TravelBounds(cell).steps(a, b, (way, 0.1))
    shares = np.linspace(0.0, 1.0, steps + 1)[-12:, None]
    poses = cells.solid_poses(cell, a + shares * (b - a), np.zeros(len(shares)))
    for i, solid in enumerate(cell.solids):
        corners = poses[:, i, :3, :3] @ solid.hull.corners.T + poses[:, i, :3, 3:]
        assert np.linalg.norm(np.diff(corners, axis=0), axis=1).max() <= way * (1 + 1e-9)


@pytest.mark.parametrize("name", ["crowd", "drive"])
@given(seed=st.integers(0, 1000))
@settings(max_examples=12)
def test_no_distance_changes_more_than_its_bound(crowd, drive, name, seed):
    cell, a, b = an_edge({"crowd": crowd, "drive": drive}[name], seed)
    times = (0.5, 2.5)
    most = TravelBounds(cell).between(a, b, times)
    shares = np.linspace(0.0, 1.0, 5)[:, None]
    moments = times[0] + shares[:, 0] * (times[1] - times[0])
    poses = cells.solid_poses(cell, a + shares * (b - a), moments)
    points = np.stack(
        [
            poses[:, i, :3, :3] @ solid.hull.corners[seed % len(solid.hull.corners)]
            + poses[:, i, :3, 3]
            for i, solid in enumerate(cell.solids)
        ],
        axis=1,
    )
    gaps = np.linalg.norm(points[:, :, None] - points[:, None], axis=-1)
    parts = [solid.part for solid in cell.solids]
    changes = np.abs(gaps - gaps[:1]) / np.maximum(shares[:, :, None], 1e-9)
    assert (changes.max(axis=0) <= most[np.ix_(parts, parts)] + 1e-9).all()


def test_what_slides_out_travels_farther_when_it_is_turned(tmp_path):
    text = urdf(
        link("base"),
        link("arm"),
        link("top"),
        joint("turn", "base", "arm"),
        joint("slide", "arm", "top", kind="prismatic", axis="1 0 0"),
    )
    cell = Cell(Layout({"one": Placement(robot(tmp_path, text, ["turn", "slide"]))}))
    for out, least in ((0.0, 0.05), (3.0, 3.0)):
        ends = np.array([[0.0, out], [1.0, out]])
        assert least <= TravelBounds(cell).steps(*ends, (0.001, 10.0)) / 1000 <= least + 0.1
        assert least <= TravelBounds(cell).between(*ends)[WORLD].max() <= least + 0.1


def test_nothing_in_the_way_is_missed(tmp_path):
    """A slide comes nearer by exactly its bound; a pole stands everywhere on its way in turn."""
    text = urdf(
        link("base", shape=""),
        link("top"),
        joint("slide", "base", "top", kind="prismatic", axis="1 0 0"),
    )
    layout = Layout({"one": Placement(robot(tmp_path, text, ["slide"]))})
    for i, x in enumerate(np.linspace(-0.05, 2.05, 22)):
        pole = box("pole", (0.004, 0.02, 0.02), (x, 0.0, 0.0))
        still = pole.moved(Track(np.zeros(1), pole.pose[None]))
        cell = Cell(layout, [still if i % 2 else pole])
        assert not cell.checker().edge_free([0.0], [2.0], (0.002, 1.0))
        assert not cell.checker(clearance=0.01).edge_free([2.0], [0.0], (0.002, 1.0))
    last = Cell(layout, [box("pole", (0.004, 0.5, 0.5), (2.0515, 0.0, 0.0))]).checker()
    for steps in range(1, 60):
        assert not last.edge_free([0.0], [2.0], (2.0 / steps, 1.0))
    for x in (-0.07, 2.07):
        cell = Cell(layout, [box("pole", (0.004, 0.5, 0.5), (x, 0.0, 0.0))])
        assert cell.checker(clearance=0.015).edge_free([0.0], [2.0], (0.002, 1.0))
        assert not cell.checker(clearance=0.02).edge_free([0.0], [2.0], (0.002, 1.0))


@pytest.mark.parametrize("resolution", [(0.05, 0.2), (0.003, 0.02)])
def test_an_edge_is_as_free_as_its_states(crowd, resolution):
    checker = crowd.checker(clearance=0.01)
    qpos, _ = cells.states(crowd, 300, seed=3)
    free = qpos[checker.free(qpos)]
    answers = []
    for a, b in zip(free[:12], free[1:13], strict=True):
        b = a + 0.1 * (b - a)
        shares = np.linspace(0.0, 1.0, checker.steps(a, b, resolution) + 1)
        alone = checker.free(a + shares[:, None] * (b - a), 1.5 * shares).all()
        answers.append(checker.edge_free(a, b, resolution, times=(0.0, 1.5)))
        assert answers[-1] == alone
    assert 0 < np.mean(answers) < 1


# -- invalid arguments -------------------------------------------------------------------------


def test_wrong_arguments_are_refused_in_words(crowd):
    checker = crowd.checker()
    with pytest.raises(LayoutError, match=rf"shape \(3,\); this cell takes \(n, {crowd.size}\)"):
        checker.free(np.zeros(3))
    with pytest.raises(LayoutError, match="finite"):
        checker.free(np.full((1, crowd.size), np.nan))
    with pytest.raises(LayoutError, match=r"times have the shape \(2,\); 1 states"):
        checker.free(crowd.start[None], [0.0, 1.0])
    with pytest.raises(LayoutError, match="resolution"):
        checker.edge_free(crowd.start, crowd.start, (0.0, 0.1))
    with pytest.raises(UnknownNameError, match="Did you mean 'left/panda_hand'"):
        crowd.checker(except_=[("left/panda_hnd", "crate")])
    with pytest.raises(UnknownNameError, match="lef"):
        crowd.checker(moving=["lef"])
    with pytest.raises(LayoutError, match="clearance is -1"):
        crowd.checker(clearance=-1.0)
    with pytest.raises(UnknownNameError, match="nobody"):
        crowd.grasped("nobody", box("cube", (0.1, 0.1, 0.1)))


@pytest.mark.parametrize("name", ["left", "table", "crate"])
def test_every_body_has_its_own_name(crowd, name):
    twice = [*crowd.obstacles, box(name, (0.1, 0.1, 0.1))]
    with pytest.raises(LayoutError, match=f"called {name!r}"):
        Cell(crowd.layout, twice, table=(-1, -1, 1, 1))
