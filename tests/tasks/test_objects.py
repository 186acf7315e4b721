"""Things of the registry as bodies of a task: built, placed, recorded, played again, exported."""

import numpy as np
import pytest

import tasks
from layouts import single
from objects import ObjectRegistry
from robot_layouts.__main__ import main
from robot_layouts.data.export.dataset import Export, export
from robot_layouts.experts.obstacles import _obstacle
from robots import DescriptorError, TaskError, UnknownNameError
from tasks import (
    Area,
    Fixed,
    MultiRobotTask,
    Object,
    Randomization,
    Texture,
    World,
    add_object,
    register_task,
)
from tasks.view import body_parts
from tests.tasks.own import recorded

ID = "TestSetTheTable-v1"


class SetTheTable(MultiRobotTask):
    """A mug and a pot on a table, and a can that lies."""

    layout = single({"arm": "panda"})
    max_episode_steps = 20

    mug = Object("mug", spawn=Area(x=(-0.1, 0.0), y=(-0.2, -0.1), yaw="any"))
    pot = Object("pot_two_handles", seed=4, spawn=Area(x=0.05, y=0.2))
    can = Object("can", rest="lying", spawn=Area(x=-0.2, y=0.05, yaw=(-0.3, 0.3)))

    def evaluate(self, state):
        """Success: the mug is in the air."""
        return {"success": state.position("mug")[:, 2] > 0.1}


@pytest.fixture(scope="module", autouse=True)
def _registered():
    register_task(ID)(SetTheTable)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    return recorded(ID, tmp_path_factory.mktemp("objects"))


def test_things_lie_where_episodes_begin_with_them_and_stay_there():
    env = tasks.make(ID, num_envs=2)
    env.reset(seed=0)
    state = env.state
    start = {name: state.pose(name) for name in ("mug", "pot", "can")}
    assert set(start) < set(env.get_state_dict()["actors"])
    assert start["can"][:, 2] == pytest.approx(ObjectRegistry.load("can").sizes["radius"])
    assert not np.array_equal(start["mug"][0], start["mug"][1])
    assert env.simulation.worlds[0].bodies["pot"].shapes == (
        ObjectRegistry.load("pot_two_handles", seed=4).parts
    )
    for _ in range(20):
        env.step(np.zeros((2, 8)))
    for name, pose in start.items():
        assert np.abs(env.state.pose(name) - pose).max() < 1e-3, name
    env.reset(seed=0)
    assert np.array_equal(env.state.pose("mug"), start["mug"])


def test_a_recording_is_played_again_to_the_last_bit_and_exported(recording, tmp_path, capsys):
    assert main(["replay", str(recording)]) == 0
    assert "in 2 all states are equal to the last b" in " ".join(capsys.readouterr().out.split())
    done = export(Export(recording, "lerobot", tmp_path / "dataset", include_failures=True))
    assert (done.episodes, done.steps) == (2, 40)


@pytest.mark.parametrize(
    ("declare", "error", "message"),
    [
        (lambda: Object("mugg"), UnknownNameError, "unknown object 'mugg'. Did you mean 'mug'?"),
        (lambda: Object("mug", rest="lying"), UnknownNameError, "unknown rest of mug 'lying'"),
        (lambda: Object("mug", seed=-1), DescriptorError, "mug: seed is -1; it must be an integer"),
        (lambda: Object("mug", scale=0), TaskError, "Object: scale is 0; it must be a number from"),
        (lambda: Object(5), TaskError, "Object: thing is 5; it must be an ObjectDescriptor or a t"),
        (
            lambda: Object(ObjectRegistry.load("mug"), seed=3),
            TaskError,
            "Object: mug is given as a descriptor and with seed=3",
        ),
    ],
)
def test_what_no_thing_can_be_is_refused_where_it_is_declared(declare, error, message):
    with pytest.raises(error, match=f"^{message}"):
        declare()


def test_add_object_puts_it_down_as_it_rests():
    world = World(single({"arm": "panda"}))
    lying = ObjectRegistry.load("can").rest("lying")
    can = add_object(world, "can", "can", (0.1, 0.2, 0.3), lying)
    body = world.bodies["can"]
    assert body.position == pytest.approx((0.1, 0.2, 0.3 + can.sizes["radius"]))
    assert body.quaternion == lying
    mug = add_object(world, "cup", "mug", seed=2, kind="static")
    assert mug == ObjectRegistry.load("mug", seed=2)
    assert world.bodies["cup"].kind == "static"


def test_pages_and_motions_know_the_parts():
    for name in ("mug", "gear", "bottle"):
        world = World(single({"arm": "panda"}))
        thing = add_object(world, "it", name)
        assert len(body_parts(thing.parts)) == len(thing.parts)
        obstacle = _obstacle(world.bodies["it"])
        assert len(obstacle.shapes) == len(thing.parts)
        corners = np.concatenate(obstacle.shapes)
        assert np.ptp(corners, axis=0) == pytest.approx(thing.extent, rel=0.01)


def test_a_pattern_covers_it_in_pictures(drawn):
    checker = Texture(kinds=("checker",), cells=Fixed(4))
    pictures: list[np.ndarray] = []
    for varied in (None, Randomization(textures={"pot": checker})):
        env = tasks.make(ID, render_mode="rgb_array", randomization=varied)
        env.reset(seed=0)
        pictures.append(env.render()[0].astype(float))
    changed = np.abs(pictures[0] - pictures[1]).max(axis=-1) > 20
    assert 0.01 < changed.mean() < 0.3


def test_another_member_of_a_family_in_each_episode():
    class Varied(SetTheTable):
        rebuilds = True

        def design(self, rng):
            return ObjectRegistry.load("bowl", seed=int(rng.uniform(1)[0] * 2**31))

        def build(self, world):
            super().build(world)
            add_object(world, "bowl", world.design, (0.2, -0.2, 0.0))

    register_task("TestVaried-v1")(Varied)
    env = tasks.make("TestVaried-v1", num_envs=2)
    env.reset(seed=0)
    first = [world.design for world in env.simulation.worlds]
    assert first[0] != first[1]
    env.reset(seed=1)
    assert env.simulation.worlds[0].design == first[1]
