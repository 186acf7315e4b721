"""Messages: whatever they quote, a reader can take them in."""

import pickle

import pytest

from robot_layouts.core.quoting import MOST_CHARACTERS
from robots import LayoutError, RobotRegistry, UnknownNameError


def test_a_long_name_is_quoted_by_its_beginning_and_its_end():
    with pytest.raises(UnknownNameError) as caught:
        RobotRegistry.load("a" * 10**7 + "z")
    message = str(caught.value)
    assert message.startswith("unknown robot 'aaaa")
    assert "…" in message
    assert "z'. `robot-layouts robots list` has all" in message
    assert len(message) < 400
    assert str(pickle.loads(pickle.dumps(caught.value))) == message


def test_no_message_is_longer_than_a_page_whatever_it_quotes():
    message = str(LayoutError(f"no such place: {'x' * 10**7}; choose another"))
    assert len(message) == MOST_CHARACTERS
    assert message.startswith("no such place: xxx")
    assert message.endswith("xxx; choose another")
    assert str(LayoutError("y" * MOST_CHARACTERS)) == "y" * MOST_CHARACTERS


def test_a_short_name_is_quoted_whole_with_the_closest_match():
    with pytest.raises(UnknownNameError, match="^unknown robot 'pandda'. Did you mean 'panda'?"):
        RobotRegistry.load("pandda")
