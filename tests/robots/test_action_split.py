"""Properties of every possible action split."""

from __future__ import annotations

import copy
import pickle
from keyword import iskeyword
from string import ascii_lowercase

from hypothesis import given
from hypothesis import strategies as st

from robots import ActionSplit, JointGroup

NAME = st.text(ascii_lowercase, min_size=1, max_size=6).filter(lambda name: not iskeyword(name))
NAMES = st.lists(NAME, min_size=1, max_size=5, unique=True)


@st.composite
def splits(draw: st.DrawFn) -> ActionSplit:
    groups: dict[str, JointGroup] = {}
    for name in draw(NAMES):
        count = draw(st.integers(1, 4))
        groups[name] = JointGroup(
            tuple(f"{name}_{i}" for i in range(count)),
            lower=-draw(st.floats(0.01, 3)),
            upper=draw(st.floats(0.01, 3)),
            stiffness=draw(st.floats(0, 1e4)),
            damping=draw(st.floats(0, 1e4)),
            force_limit=100.0,
            delta=draw(st.booleans()),
            mimic=draw(st.booleans()),
        )
    return ActionSplit(**groups)


@given(splits())
def test_slices_partition_the_action_in_order(split):
    """So that an action is split and joined without loss."""
    numbers = [i for piece in split.values() for i in range(piece.start, piece.stop)]
    assert numbers == list(range(split.size))
    for name, group in split.groups.items():
        expected = 1 if group.mimic else len(group.joints)
        assert split[name].stop - split[name].start == group.size == expected
    assert split.joints == tuple(j for group in split.groups.values() for j in group.joints)


@given(splits())
def test_values_keep_their_hash_and_the_order_of_groups(split):
    for other in (pickle.loads(pickle.dumps(split)), copy.copy(split), copy.deepcopy(split)):
        assert other == split
        assert hash(other) == hash(split)
        assert list(other.items()) == list(split.items())
    assert eval(repr(split)) == split
    turned = ActionSplit(**dict(reversed(split.groups.items())))
    assert (turned == split) == (len(split) == 1)
    assert {n: p.stop - p.start for n, p in turned.items()} == {
        n: p.stop - p.start for n, p in split.items()
    }
