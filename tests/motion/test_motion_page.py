"""Motions in a browser."""

from __future__ import annotations

from urllib.parse import urlsplit

import numpy as np
import pytest

from benchmarks.teleop import served
from layouts import face_to_face
from robot_layouts.motion.output.scenes import motion_cell
from tests.experts.free_motions import swing
from tests.motion.motions import LAYOUT, busy_motion
from tests.pages import browser_page, changed, coloured, settled

BLUE, ORANGE = (0, 114, 178), (213, 94, 0)  # of left and right
SMALL = face_to_face({"left": "so100", "right": "so100"}, spacing=0.5)  # quickly drawn


def test_a_page_shows_what_moves_and_what_stands():
    motion = busy_motion()
    cell = motion_cell(motion, "busy")
    assert cell.title == "busy"
    assert cell.motion.name == "Motion"
    assert set(cell.things) == {"wall", "ball", "cube", "(table)"}
    assert set(cell.motion.poses) == {"ball", "cube"}
    assert len(cell.motion) == 46
    assert cell.motion.step_seconds * 45 == pytest.approx(motion.duration)
    assert np.array_equal(cell.motion.qpos["left"][-1], motion.end["left"])
    assert cell.motion.poses["ball"][-1] == pytest.approx([0.5, 0, 0, 0, 0, 0, 1])
    carried = np.linalg.norm(cell.motion.poses["cube"][-1, :3] - cell.motion.poses["cube"][0, :3])
    (way,) = cell.ways["left"]
    assert carried > 0.05
    assert np.linalg.norm(way[0] - cell.motion.poses["cube"][0, :3]) == pytest.approx(0.1, abs=1e-6)
    assert set(cell.ways) == set(LAYOUT)


@pytest.mark.long
@pytest.mark.browser
def test_a_motion_is_scrubbed_and_played(tmp_path):
    file = swing(SMALL, seconds=1.0, far=0.8).save(tmp_path / "motion.json")
    with (
        served("robot_layouts", "motion", "show", str(file), "--port", "0") as view,
        browser_page() as (page, asked),
    ):
        page.goto(view.url)
        start = settled(page, lambda now: coloured(now, BLUE) > 20 < coloured(now, ORANGE))
        page.get_by_text("step 0 of 30, 0.00 s").wait_for()
        timeline = page.get_by_role("slider").first
        timeline.focus()
        timeline.press("End")
        page.get_by_text("step 30 of 30, 1.00 s").wait_for()
        end = settled(page, lambda now: changed(now, start) > 500)
        page.get_by_role("checkbox", name="Paths").click()
        settled(page, lambda now: coloured(now, BLUE) < coloured(end, BLUE) / 2)
        page.get_by_role("checkbox", name="Paths").click()
        page.get_by_label("Play").click()
        page.get_by_text("step 30 of 30, 1.00 s").wait_for(state="hidden")
        at = urlsplit(view.url).netloc
        assert {urlsplit(address.removeprefix("blob:")).netloc for address in asked} <= {at, ""}
        assert view.interrupt()[0] == 0
