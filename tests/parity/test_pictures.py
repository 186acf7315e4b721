"""Pictures drawn in native's scene show what native shows, and every small change of a state."""

import functools

import numpy as np
import pytest

import tasks
from parity.compare.both_sides import NativeSide, OurSide
from parity.compare.episodes import random_episodes
from parity.compare.snapshot import Snapshot
from parity.show.native_pictures import (
    NativeScene,
    PictureError,
    amplified,
    difference,
    expect_same_shapes,
)
from parity.show.side_by_side import HONEST, play_and_look
from tests.native import NATIVE, TASKS

SIZE = 192  # pixels
SHIFT = 1e-3  # m or rad

# Robots and whatever else stands or lies in view of native's camera after the reset of seed 0.
IN_VIEW = [
    ("PickCube-v1", "object pose", "cube", 0),
    ("PickCube-v1", "object pose", "goal_site", 0),  # hidden from native's own observations
    ("PickCube-v1", "qpos", "panda", 0),
    ("PickCube-v1", "qpos", "panda", 8),  # a finger
    ("TwoRobotPickCube-v1", "qpos", "panda_wristcam-agent-0", 3),
    ("TwoRobotPickCube-v1", "qpos", "panda_wristcam-agent-1", 3),
    ("PegInsertionSide-v1", "object pose", "peg", 0),
    ("PegInsertionSide-v1", "object pose", "box_with_hole", 0),
    ("DrawTriangle-v1", "object pose", "goal_tri", 0),
]


@functools.cache
def native(task_id: str) -> NativeSide:
    return NativeSide(task_id, picture_size=SIZE)


@functools.cache
def after_reset(task_id: str) -> tuple[NativeScene, Snapshot]:
    found = native(task_id).reset([0], [0], rebuild=True)
    return NativeScene(native(task_id).envs[0]), found


def changed(snapshot: Snapshot, quantity: str, entry: str, number: int, by: float) -> Snapshot:
    copied = {key: values.copy() for key, values in snapshot.items()}
    copied[quantity, entry][0, number] += by
    return copied


def expect_honest(task_id: str) -> None:
    """Drawing what native went through shows what native showed, and ours the same."""
    side, ours = native(task_id), OurSide(tasks.make(task_id))
    scene = NativeScene(side.envs[0])
    (episode,) = random_episodes([1], 6, side.action_dim)
    playback, apart = play_and_look(side, ours, episode, scene)
    assert apart <= HONEST
    expect_same_shapes(side.envs[0], ours.env)
    moved = difference(scene.draw(playback.native[0]), scene.draw(playback.native[6])).mean()
    assert moved > 3 * HONEST, "the check would not have noticed a picture of another moment"
    assert not difference(scene.draw(playback.native[6]), scene.draw(playback.ours[6])).any()


@pytest.mark.long
class TestDrawing:
    pytestmark = [*NATIVE, pytest.mark.usefixtures("renderer")]

    @pytest.mark.long
    @pytest.mark.parametrize("task_id", ["TwoRobotPickCube-v1", "DrawTriangle-v1"])
    def test_what_is_drawn_is_what_native_shows(self, task_id):
        expect_honest(task_id)

    @pytest.mark.long
    @pytest.mark.parametrize("task_id", TASKS)
    def test_what_is_drawn_is_what_native_shows_in_every_task(self, task_id):
        expect_honest(task_id)

    @pytest.mark.long
    @pytest.mark.parametrize(("task_id", "quantity", "entry", "number"), IN_VIEW)
    def test_a_millimetre_or_milliradian_is_seen(self, task_id, quantity, entry, number):
        scene, found = after_reset(task_id)
        # A pixel is some millimetres wide: of three small steps, one moves an edge over a pixel.
        shifts = (SHIFT, 2 * SHIFT, 3 * SHIFT)
        seen = [
            difference(scene.draw(found), scene.draw(changed(found, quantity, entry, number, by)))
            for by in shifts
        ]
        assert any(delta.any() for delta in seen)
        assert not difference(scene.draw(found), scene.draw(found)).any(), "drawing is not exact"

    @pytest.mark.long
    def test_a_dot_that_was_drawn_is_seen(self):
        scene, found = after_reset("DrawTriangle-v1")
        raised = changed(found, "object pose", "dot_7", 2, 0.05)
        assert difference(scene.draw(found), scene.draw(raised)).any()

    @pytest.mark.long
    def test_a_picture_of_another_moment_is_noticed(self):
        class Forgetful(NativeScene):
            def draw(self, snapshot):
                return super().draw(first)

        first = after_reset("PickCube-v1")[1]
        (episode,) = random_episodes([0], 6, 8)
        side = native("PickCube-v1")
        with pytest.raises(PictureError, match=r"step \d looks otherwise drawn than live, by"):
            play_and_look(
                side, OurSide(tasks.make("PickCube-v1")), episode, Forgetful(side.envs[0])
            )

    def test_a_body_that_native_lacks(self):
        scene, found = after_reset("PickCube-v1")
        without = {key: values for key, values in found.items() if key[1] != "cube"}
        with pytest.raises(PictureError, match="only one of them has the actors cube"):
            scene.draw(without)

    def test_another_robot(self):
        scene, found = after_reset("PickCube-v1")
        ours = OurSide(tasks.make("PickCube-v1", robots={"arm": "panda_wristcam"}))
        with pytest.raises(PictureError, match="the articulations panda, panda_wristcam"):
            scene.draw(ours.reset([0], [0], rebuild=True))

    def test_a_state_that_is_not_finite(self):
        scene, found = after_reset("PickCube-v1")
        with pytest.raises(PictureError, match=r"cube cannot be drawn: its state is \[nan,"):
            scene.draw(changed(found, "object pose", "cube", 0, np.nan))

    def test_geometry_of_another_episode(self):
        env = tasks.make("PegInsertionSide-v1")
        native("PegInsertionSide-v1").reset([0], [0], rebuild=True)
        env.reset(seed=0)
        expect_same_shapes(native("PegInsertionSide-v1").envs[0], env)
        env.reset(seed=1)
        with pytest.raises(PictureError, match="peg has other shapes in native than here"):
            expect_same_shapes(native("PegInsertionSide-v1").envs[0], env)


def test_a_difference_has_no_sign():
    a, b = np.array([[[0, 200, 7]]], np.uint8), np.array([[[255, 100, 7]]], np.uint8)
    assert difference(a, b).tolist() == difference(b, a).tolist() == [[[255, 100, 0]]]


def test_an_amplified_difference_stays_visible():
    delta = np.array([[[0, 1, 40]]], np.uint8)
    assert amplified(delta, 8).tolist() == [[[0, 8, 255]]]
    assert amplified(delta, 0.1).tolist() == [[[0, 1, 4]]]
