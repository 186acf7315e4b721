"""Pictures of native and ours: what native's scene shows, and what a clip says."""

import functools
import json

import imageio.v3 as imageio
import numpy as np
import pytest

import tasks
from parity.__main__ import main
from parity.episodes import Source, random_episodes
from parity.lockstep import NativeSide, OurSide, Snapshot
from parity.render import HONEST, Tape, is_verified, make_clip, play_and_look
from parity.scene import NativeScene, PictureError, amplified, difference, expect_same_shapes
from tests.native import NATIVE, TASKS
from tests.parity.test_episodes import demonstration

SIZE = 192  # pixels
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


@pytest.mark.long
class TestDrawing:
    pytestmark = [*NATIVE, pytest.mark.usefixtures("renderer")]

    @pytest.mark.parametrize("task_id", TASKS)
    def test_what_is_drawn_is_what_native_shows(self, task_id):
        side = native(task_id)
        theirs, ours = Tape(side), Tape(OurSide(tasks.make(task_id)))
        scene = NativeScene(side.envs[0])
        source = Source("random", tuple(random_episodes([1], 6, side.action_dim)))
        _, apart = play_and_look(theirs, ours, source, scene)
        assert apart <= HONEST
        drawn = [scene.draw(theirs.snapshots[step]) for step in (0, 6)]
        assert difference(*drawn).mean() > 3 * HONEST, "another moment would not be noticed"
        assert not difference(drawn[1], scene.draw(ours.snapshots[6])).any()

    @pytest.mark.parametrize(("task_id", "quantity", "entry", "number"), IN_VIEW)
    def test_a_millimetre_or_milliradian_is_seen(self, task_id, quantity, entry, number):
        scene, found = after_reset(task_id)
        # A pixel is some millimetres wide: of three small steps, one moves an edge over a pixel.
        seen = [
            difference(scene.draw(found), scene.draw(changed(found, quantity, entry, number, by)))
            for by in (0.001, 0.002, 0.003)
        ]
        assert any(delta.any() for delta in seen)
        assert not difference(scene.draw(found), scene.draw(found)).any(), "drawing is not exact"

    def test_what_cannot_be_drawn(self):
        scene, found = after_reset("PickCube-v1")
        without = {key: values for key, values in found.items() if key[1] != "cube"}
        with pytest.raises(PictureError, match="only one of them has the actors cube"):
            scene.draw(without)
        with pytest.raises(PictureError, match=r"cube cannot be drawn: its state is \[nan,"):
            scene.draw(changed(found, "object pose", "cube", 0, np.nan))
        ours = OurSide(tasks.make("PickCube-v1", robots={"arm": "panda_wristcam"}))
        with pytest.raises(PictureError, match="the articulations panda, panda_wristcam"):
            scene.draw(ours.reset([0], [0], rebuild=True))

    def test_geometry_of_another_episode(self):
        env, side = tasks.make("PegInsertionSide-v1"), native("PegInsertionSide-v1")
        side.reset([0], [0], rebuild=True)
        env.reset(seed=0)
        expect_same_shapes(side.envs[0], env)
        env.reset(seed=1)
        with pytest.raises(PictureError, match="peg has other shapes in native than here"):
            expect_same_shapes(side.envs[0], env)


@pytest.mark.long
class TestClips:
    pytestmark = [*NATIVE, pytest.mark.usefixtures("renderer")]

    def test_of_equal_sides(self, tmp_path):
        demo = demonstration(tmp_path / "planned", control_mode="pd_joint_pos")
        words = ("--demo", str(demo), "--seed", "41", "--out", str(tmp_path), "--size", str(SIZE))
        assert main(["render", "--task", "maniskill.pick_cube_native", *words]) == 1, (
            "it does not succeed"
        )
        folder = tmp_path / "PickCube-v1"
        found = json.loads((folder / "side_by_side.json").read_text())
        assert (found["seed"], found["source"]) == (41, "planned/trajectory")
        assert (found["steps"], found["frames"], found["differing_frames"]) == (4, 5, 0)
        assert found["max_state_difference"] == found["mean_pixel_difference"] == 0
        frames = imageio.imread(folder / "side_by_side.mp4")[:, -SIZE:]
        theirs, ours, delta = (frames[:, :, i * SIZE : (i + 1) * SIZE] for i in range(3))
        assert len(frames) == 5
        assert theirs.std() > 20, "there is something to see"
        assert np.abs(theirs.astype(int) - ours).mean() < 2, "h264 is not exact"
        assert delta.max() < 16
        assert imageio.imread(folder / "side_by_side.png").shape[2] == 3

    def test_of_sides_that_differ(self, tmp_path, monkeypatch):
        reset = OurSide.reset
        monkeypatch.setattr(
            OurSide,
            "reset",
            lambda side, seeds, ids, rebuild: reset(side, [seeds[0] + 1], ids, rebuild=rebuild),
        )
        source = Source("random", tuple(random_episodes([4], 4, 8)))
        found = make_clip("PickCube-v1", source, tmp_path, size=SIZE)
        assert not is_verified(found)
        assert found["differing_frames"] == found["frames"] == 5
        assert found["max_state_difference"] > 1e-3
        assert found["mean_pixel_difference"] > 0.05


def test_a_difference_has_no_sign_and_stays_visible():
    a, b = np.array([[[0, 200, 7]]], np.uint8), np.array([[[255, 100, 7]]], np.uint8)
    assert difference(a, b).tolist() == difference(b, a).tolist() == [[[255, 100, 0]]]
    delta = np.array([[[0, 1, 40]]], np.uint8)
    assert amplified(delta, 8).tolist() == [[[0, 8, 255]]]
    assert amplified(delta, 0.1).tolist() == [[[0, 1, 4]]]
