"""What of a mesh file collides: its hull, the hulls of its pieces, or its surface."""

import pytest
import trimesh

from layouts import single
from objects.shapes import Mesh, Sphere
from robot_layouts.simulation import Simulation, World
from robot_layouts.simulation.checks.overlaps import stand
from robots import AssetError, SimulationError

RADIUS, BOTTOM, RIM = 0.03, 0.01, 0.1  # m; of the ball, and how high the cup's are


@pytest.fixture
def cup(tmp_path):
    """Return the file of a cup of five boxes, which opens upwards."""
    made = [((0.2, 0.2, BOTTOM), (0.0, 0.0, BOTTOM / 2))]
    for sign in (-1, 1):
        made.append(((0.02, 0.2, RIM), (sign * 0.09, 0.0, RIM / 2)))
        made.append(((0.2, 0.02, RIM), (0.0, sign * 0.09, RIM / 2)))
    boxes = [trimesh.creation.box(size).apply_translation(place) for size, place in made]
    trimesh.util.concatenate(boxes).export(tmp_path / "cup.ply")
    return tmp_path / "cup.ply"


def dropped(cup, collision, simulator):
    """Return the height at which a ball comes to rest that falls into a cup (m)."""

    def build(world: World, _: int) -> None:
        far = {"position": (2.0, 0.0, 0.0), "kind": "kinematic"}
        world.add("cup", Mesh(cup, collision=collision), **far)
        world.add("ball", Sphere(radius=RADIUS), position=(2.0, 0.0, RIM + 0.05))

    simulation = Simulation(single({"arm": "panda"}), build, 1, simulator=simulator)
    stand(simulation)
    for _ in range(30):
        simulation.coast([0])
    return float(simulation.read().position("ball")[0, 2])


@pytest.mark.parametrize("simulator", ["sapien3", "mujoco"])
@pytest.mark.parametrize(
    ("collision", "below"), [("hull", RIM), ("pieces", BOTTOM), ("surface", BOTTOM)]
)
def test_a_ball_lies_in_a_cup_unless_its_hull_collides(cup, collision, below, simulator):
    height = dropped(cup, collision, simulator)
    assert height == pytest.approx(below + RADIUS, abs=2e-3)


@pytest.mark.parametrize("simulator", ["sapien3", "mujoco"])
def test_a_surface_of_one_piece_is_hollow_where_it_is(tmp_path, simulator):
    outside, inside = trimesh.creation.box((0.2, 0.2, RIM)), trimesh.creation.box((0.16, 0.16, RIM))
    inside.apply_translation((0, 0, BOTTOM))
    cup = trimesh.boolean.difference([outside, inside]).apply_translation((0, 0, RIM / 2))
    cup.export(tmp_path / "cup.ply")
    height = dropped(tmp_path / "cup.ply", "surface", simulator)
    assert height == pytest.approx(BOTTOM + RADIUS, abs=2e-3)


@pytest.mark.parametrize("simulator", ["sapien3", "mujoco"])
@pytest.mark.parametrize("collision", ["hull", "pieces", "surface"])
@pytest.mark.parametrize("name", ["none.ply", "empty.obj", "lie.glb", "flat.ply"])
def test_a_file_that_is_no_solid_is_named(name, collision, simulator, tmp_path):
    (tmp_path / "empty.obj").write_text("")
    (tmp_path / "lie.glb").write_bytes(b"glTF not")
    trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]).export(tmp_path / "flat.ply")
    with pytest.raises(AssetError, match=name):
        dropped(tmp_path / name, collision, simulator)


def test_flat_pieces_are_no_solid_in_mujoco(tmp_path):
    sheets = [trimesh.creation.box((0.1, 0.1, 1e-9)).apply_translation((0, 0, z)) for z in (0, 1)]
    trimesh.util.concatenate(sheets).export(tmp_path / "sheets.ply")
    with pytest.raises(AssetError, match="no piece of the mesh"):
        dropped(tmp_path / "sheets.ply", "pieces", "mujoco")


def test_a_surface_of_a_body_that_physics_moves_is_refused(cup):
    world = World(single({"arm": "panda"}))
    with pytest.raises(SimulationError, match="body 'cup' is dynamic, and the surface of a mesh"):
        world.add("cup", Mesh(cup, collision="surface"))
    world.add("cup", Mesh(cup, collision="surface", collides=False))


def test_a_word_that_says_nothing_is_refused(cup):
    with pytest.raises(SimulationError, match="Mesh: collision is 'box'; it must be 'hull' or"):
        Mesh(cup, collision="box")
