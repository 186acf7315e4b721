"""A task refuses a layout whose robots collide, unless told otherwise."""

import sys
from dataclasses import replace

import pytest

import tasks
from layouts import Layout, Placement, around_table, face_to_face, side_by_side
from robots import LayoutError, RobotRegistry, TaskError
from tasks.engine.places import refuse_collisions
from tests.experts.free_motions import FreeRobots

TWO = "TwoRobotPickCube-v1"
PANDAS = {"left": "panda_wristcam", "right": "panda_wristcam"}


def crowded():
    return side_by_side(PANDAS, spacing=0.1)


def test_colliding_robots_are_refused_with_their_links_and_what_to_change():
    with pytest.raises(LayoutError) as caught:
        tasks.make(TWO, layout=crowded())
    message = str(caught.value)
    assert "left.panda_link2 with right.panda_link1 (11.0 cm)" in message
    assert "m farther apart" in message
    assert "check_layout=False builds it all the same" in message


def test_a_folded_arm_that_grazes_itself_with_joint_noise_is_built():
    layout = side_by_side({f"arm_{i}": "koch" for i in range(6)}, spacing="auto")
    assert layout.validate(workspaces=False).findings
    refuse_collisions(layout)


def test_other_robots_at_the_same_places_are_checked_too():
    with pytest.raises(LayoutError, match="collide"):
        tasks.make(TWO, layout=crowded(), robots={"right": "panda_stick"})


class Crowded(FreeRobots):
    """A task of a user's, whose arms stand 8 cm inside each other."""

    layout = face_to_face(PANDAS, spacing=1.25)


def test_a_users_own_layout_is_checked_as_another_one_is():
    with pytest.raises(LayoutError, match=r"left and right collide(.|\n)*m farther apart"):
        Crowded(Crowded.scenario)
    Crowded(replace(Crowded.scenario, check_layout=False)).close()
    Crowded(replace(Crowded.scenario, layout=FreeRobots.layout)).close()


def test_without_fcl_it_warns_with_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "fcl", None)
    layout = face_to_face(PANDAS, spacing=1.37)
    with pytest.warns(UserWarning, match=r"unchecked: .*pip install 'robot-layouts\[checks\]'"):
        tasks.make(TWO, layout=layout).close()


def test_a_choice_that_is_none_is_refused():
    with pytest.raises(TaskError, match="check_layout is 'no'; it must be True or False"):
        tasks.make(TWO, check_layout="no")


@pytest.mark.parametrize("task_id", tasks.list_tasks())
def test_every_task_has_a_layout_that_passes(task_id):
    task = tasks.get_task_class(task_id)
    refuse_collisions(task.layout, task.table.outline(task.layout))


def test_a_robot_in_a_table_of_its_layout_is_refused():
    layout = around_table({"arm": "panda"}, edges=["north"])
    sunk = Layout({"arm": replace(layout["arm"], position=(0.1, 0.0, -0.3))}, layout.frames)
    with pytest.raises(LayoutError, match="arm and table collide at the keyframes"):
        refuse_collisions(sunk)


def test_a_robot_that_collides_with_itself_is_refused():
    panda = RobotRegistry.load("panda")
    # The hand over the base, elbow bent as far as it goes.
    bent = (0.0, -1.7, 0.0, -3.05, 0.0, 0.0, 0.0, 0.04, 0.04)
    layout = Layout({"arm": Placement(replace(panda, keyframes={"rest": bent}))})
    with pytest.raises(LayoutError, match="arm touches itself at the keyframes: arm.panda_"):
        refuse_collisions(layout)


def test_a_robot_inside_the_tasks_own_table_is_refused():
    low = {name: Placement("panda", (x, 0.0, -0.5)) for name, x in (("left", -0.8), ("right", 0.8))}
    with pytest.raises(LayoutError, match="left and table collide at the keyframes"):
        tasks.make(TWO, layout=Layout(low))
    three = {f"arm_{i}": Placement("panda", (i * 1.5, 0.0, -0.5)) for i in range(3)}
    with pytest.raises(LayoutError, match="arm_0 and table collide"):
        tasks.make("Relay-v1", layout=Layout(three))
