"""The top view: a whole picture with something drawn at each robot's place."""

import math
import sys

import numpy as np
import pytest

from layouts import Layout, Placement, around_table, ceiling, face_to_face, grid, ring, single, wall
from layouts.preview import WIDTH, draw
from robot_layouts.core.figures import DOTS_PER_INCH, SUPPORTED
from robots import LayoutError, MissingPackageError


def mixed(count):
    robots = ("panda", "panda_stick", "panda_wristcam")
    return {f"arm_{i}": robots[i % len(robots)] for i in range(count)}


LAYOUTS = {
    "one": single({"arm": "panda"}),
    "two": face_to_face({"left": "panda_wristcam", "right": "panda_stick"}, spacing=1.5),
    "six": ring(mixed(6), radius=0.9),
    "eight": ring({**mixed(7), "small": "so100"}),
    "table": around_table(mixed(5)),
    "grid": grid(mixed(7)),
    "hanging": Layout(
        {
            "above": Placement("panda", on="roof"),
            "beside": Placement("panda_stick", on="wall"),
            "second": Placement("so100", (0.0, 0.5, 0.0), on="above"),
        },
        {"roof": ceiling(1.5), "wall": wall((1.0, 0.5, 0.5), yaw=math.pi)},
    ),
    "upwards": Layout({"arm": Placement("panda", quaternion=(0.5**0.5, 0, -(0.5**0.5), 0))}),
}


def pixels(layout, figure):
    """Draw a figure; return the image, and the pixel (row, column) of each robot's base."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    image = np.asarray(canvas.buffer_rgba())[..., :3].astype(int)
    plan = figure.axes[0]
    places = {
        name: plan.transData.transform(placement.base_position[:2])
        for name, placement in layout.items()
    }
    return image, {name: (len(image) - round(y), round(x)) for name, (x, y) in places.items()}


def texts(figure):
    return [text.get_text() for axes in figure.axes for text in axes.texts]


@pytest.mark.parametrize("name", LAYOUTS)
def test_every_robot_is_drawn_at_its_place_and_named_with_its_reach(name):
    layout = LAYOUTS[name]
    figure = draw(layout)
    image, places = pixels(layout, figure)
    for row, column in places.values():
        around = image[row - 20 : row + 20, column - 20 : column + 20]
        colourful = around.max(axis=-1) - around.min(axis=-1) > 80
        assert colourful.mean() > 0.05
    assert (image[:10] == 255).all()
    written = texts(figure)
    for place, placement in layout.items():
        part = layout.action_split[place]
        assert place in written
        assert placement.robot.name in written
        assert f"{part.start}:{part.stop}" in written
    plan = figure.axes[0]
    (x_min, x_max), (y_min, y_max) = plan.get_xlim(), plan.get_ylim()
    for placement in layout.values():
        x, y, _ = placement.base_position
        reach = placement.robot.reach
        assert x_min < x - reach < x + reach < x_max
        assert y_min < y - reach < y + reach < y_max
    box = plan.get_window_extent()  # metres are square
    assert box.width / (x_max - x_min) == pytest.approx(box.height / (y_max - y_min), rel=1e-6)


@pytest.mark.parametrize("name", ["one", "two", "six"])
def test_a_png_of_the_promised_width(name, tmp_path):
    from matplotlib.image import imread

    path = LAYOUTS[name].preview(tmp_path / "new_folder" / "cell.png")
    image = imread(path)
    assert image.shape[1] == WIDTH * DOTS_PER_INCH
    assert image.shape[0] > 0.6 * image.shape[1]
    assert [file.name for file in path.parent.iterdir()] == ["cell.png"]


@pytest.mark.parametrize(("suffix", "start"), [(".pdf", b"%PDF"), (".svg", b"<?xml")])
def test_other_formats(suffix, start, tmp_path):
    path = LAYOUTS["two"].preview(str(tmp_path / f"cell{suffix}"))
    assert path.read_bytes().startswith(start)
    assert {suffix} < set(SUPPORTED)


@pytest.mark.parametrize("name", ["cell.jpg", "cell", "cell.png.txt"])
def test_an_unsupported_ending_names_the_supported_ones(name, tmp_path):
    with pytest.raises(LayoutError, match=rf"'{name}'; the name must end in .png, .pdf or .svg"):
        LAYOUTS["two"].preview(tmp_path / name)
    assert not any(tmp_path.iterdir())


def test_without_matplotlib_the_error_names_the_command(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'robot-layouts\[preview\]'"):
        LAYOUTS["two"].preview(tmp_path / "cell.png")
    assert not any(tmp_path.iterdir())


def test_a_failed_save_keeps_the_old_picture(monkeypatch, tmp_path):
    from matplotlib.figure import Figure

    path = tmp_path / "cell.png"
    path.write_text("old")

    def fail(*_, **__):
        raise OSError("disk full")

    monkeypatch.setattr(Figure, "savefig", fail)
    with pytest.raises(OSError, match="disk full"):
        LAYOUTS["two"].preview(path)
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == ["cell.png"]
