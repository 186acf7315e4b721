"""Every mistake of a task's author gives its own message, which says what to change."""

import pytest

from layouts import single
from robots import RobotLayoutsError
from tasks import Area, Cube, register_task
from tests.tasks import mistakes_declared, mistakes_placed, mistakes_returned
from tests.tasks.mistakes import Mistake, Tray

MISTAKES = (*mistakes_declared.MISTAKES, *mistakes_returned.MISTAKES, *mistakes_placed.MISTAKES)


FAMILY = (RobotLayoutsError, UserWarning)


@pytest.mark.filterwarnings("error::UserWarning")
@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda mistake: mistake.what)
def test_a_mistake_says_what_to_change(mistake):
    with pytest.raises(FAMILY) as caught:
        mistake.make()
    assert str(caught.value) == mistake.message


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: register_task(Tray), "register_task needs at least one name, the task's id, and"),
        (
            lambda: register_task("X-v1")(len),
            r"@register_task\('X-v1'\) is above <built-in func.*; it",
        ),
        (lambda: register_task("X-v1")(dict), "is above <class 'dict'>; it takes a subclass of ta"),
        (lambda: register_task("PickCube-v1")(Tray), "'PickCube-v1' is already taken by tasks.man"),
        (lambda: single({"arm": "pandda"}), "unknown robot 'pandda'. Did you mean 'panda'?"),
        (lambda: single("panda"), "robots is 'panda'; it takes a mapping from each robot's place"),
        (lambda: Area(x=(0.1, -0.1)), r"an area's x is \(0.1, -0.1\); it takes .* the smaller fir"),
        (lambda: Area(yaw="all"), "an area's yaw is 'all'; it takes a number, or the smallest and"),
        (lambda: Cube(0.02, spawn=(0.1, 0.1)), r"Cube: spawn is \(0.1, 0.1\); it must be an Area"),
    ],
)
def test_what_a_file_of_a_task_cannot_say(make, message):
    with pytest.raises(RobotLayoutsError, match=message):
        make()


@pytest.mark.filterwarnings("error")
def test_the_task_is_right_otherwise():
    """No mistake is refused for anything but itself."""
    Mistake("none", {}, "", steps=3).make()
    assert len({mistake.message for mistake in MISTAKES}) > 70
