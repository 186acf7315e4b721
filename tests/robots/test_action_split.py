"""Properties of every possible action split."""

from __future__ import annotations

import copy
import pickle
from keyword import iskeyword

from hypothesis import given
from hypothesis import strategies as st

from robots import ActionSplit, JointGroup

NAME = st.from_regex(r"[a-z]{1,6}", fullmatch=True).filter(lambda name: not iskeyword(name))
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
    numbers = [i for piece in split.values() for i in range(piece.start, piece.stop)]
    assert numbers == list(range(split.size))
    assert all(piece.stop - piece.start == split.groups[name].size for name, piece in split.items())


@given(splits())
def test_splitting_and_joining_an_action_gives_it_back(split):
    action = list(range(100, 100 + split.size))
    assert [number for piece in split.values() for number in action[piece]] == action


@given(splits())
def test_pickling_and_copying_keep_value_hash_and_order(split):
    for other in (pickle.loads(pickle.dumps(split)), copy.copy(split), copy.deepcopy(split)):
        assert other == split
        assert hash(other) == hash(split)
        assert list(other.items()) == list(split.items())
    assert eval(repr(split)) == split


@given(splits())
def test_the_order_of_groups_is_part_of_the_value(split):
    turned = ActionSplit(**dict(reversed(split.groups.items())))
    assert (turned == split) == (len(split) == 1)
    assert {n: p.stop - p.start for n, p in turned.items()} == {
        n: p.stop - p.start for n, p in split.items()
    }


@given(splits())
def test_a_mimic_group_takes_one_number_and_others_one_per_joint(split):
    for name, group in split.groups.items():
        expected = 1 if group.mimic else len(group.joints)
        assert split[name].stop - split[name].start == expected
    assert split.joints == tuple(j for group in split.groups.values() for j in group.joints)
