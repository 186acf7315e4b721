"""Pictures of robots: what is drawn, and what is written beneath."""

from __future__ import annotations

from html import unescape
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from PIL import Image

from robot_layouts.simulation.checks.commands import inspect_robots as inspect
from robots import DescriptorError, RobotRegistry
from robots.named import guessed_robot
from robots.picture import FINGER, draw, save_picture


def faces(figure: Figure, panel: int) -> np.ndarray:
    """The faces that a panel shows, (faces, 3, 2) (m)."""
    (drawn,) = (c for c in figure.axes[panel].collections if isinstance(c, PolyCollection))
    return np.array([np.asarray(path.vertices, float)[:3] for path in drawn.get_paths()])


def fingers_apart(figure: Figure, panel: int) -> float:
    """How wide the links that grasp are drawn, both together (m)."""
    (drawn,) = (c for c in figure.axes[panel].collections if isinstance(c, PolyCollection))
    hue = np.array(to_rgb(FINGER)) / np.linalg.norm(to_rgb(FINGER))
    paint = np.asarray(drawn.get_facecolor(), float)[:, :3]
    ours = np.abs(paint / np.linalg.norm(paint, axis=1, keepdims=True) - hue).max(axis=1) < 1e-6
    return float(np.ptp(faces(figure, panel)[ours][..., 0]))


def words(figure: Figure) -> str:
    return "\n".join(text.get_text() for text in figure.texts)


@pytest.mark.parametrize(
    ("name", "panels"), [("panda", 3), ("panda_stick", 1), ("tiago_pro", 5), ("baxter", 5)]
)
def test_each_gripper_is_drawn_open_and_closed(name: str, panels: int) -> None:
    assert len(draw(RobotRegistry.load(name)).axes) == panels


def test_a_panda_opens_across_the_picture() -> None:
    figure = draw(RobotRegistry.load("panda"))
    wide, narrow = (fingers_apart(figure, panel) for panel in (1, 2))
    assert wide - narrow == pytest.approx(0.08, abs=0.003)  # m: each finger moves by 0.04


def test_what_decides_how_it_works_is_written_beneath() -> None:
    text = words(draw(RobotRegistry.load("panda"), notes=["the gripper is guessed"]))
    assert "panda_hand_tcp" in text
    assert "panda_leftfinger and panda_rightfinger" in text
    assert "0.85 m" in text
    assert "the gripper is guessed" in text


def test_limbs_have_their_own_lines() -> None:
    text = words(draw(RobotRegistry.load("baxter")))
    assert "fingers of left" in text
    assert "limbs['right'].fingers=Fingers((link, link))" in text


def test_a_picture_is_saved_by_the_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "so100.png"
    assert inspect(["so100"], picture=str(path)) == 0
    assert str(path) in capsys.readouterr().out
    with Image.open(path) as picture:
        assert picture.size[0] == 1650


def test_refusals_leave_no_file(tmp_path: Path) -> None:
    path = tmp_path / "panda.jpeg"
    with pytest.raises(DescriptorError, match="panda.jpeg'; the name must end in .png"):
        save_picture(RobotRegistry.load("panda"), path)
    with pytest.raises(DescriptorError, match="one robot at a time; 2 are given"):
        inspect(["panda", "so100"], picture=str(tmp_path / "both.png"))
    assert not list(tmp_path.iterdir())


BARE = """<robot name="bare"><link name="base"/><link name="tip"/>
<joint name="j" type="revolute"><parent link="base"/><child link="tip"/><origin xyz="0 0 0.3"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


def test_a_robot_without_shapes_is_drawn_by_its_links(tmp_path: Path) -> None:
    (tmp_path / "bare.urdf").write_text(BARE)
    assert inspect([str(tmp_path / "bare.urdf")], picture=str(tmp_path / "bare.png")) == 0
    assert (tmp_path / "bare.png").exists()


def test_what_was_guessed_with_doubt_is_written_beneath(tmp_path: Path) -> None:
    (tmp_path / "bare.urdf").write_text(BARE)
    guess = guessed_robot(tmp_path / "bare.urdf")
    assert guess.doubts
    with matplotlib.rc_context({"svg.fonttype": "none"}):
        inspect([str(tmp_path / "bare.urdf")], picture=str(tmp_path / "bare.svg"))
    text = unescape((tmp_path / "bare.svg").read_text())
    assert all(doubt[:40] in text for doubt in guess.doubts)
