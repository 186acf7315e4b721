"""``python -m layouts view`` in a real browser."""

from urllib.parse import urlsplit

import pytest
import viser

from benchmarks.teleop import PATIENCE, SOFTWARE_WEBGL, running_browser, served
from layouts.__main__ import main
from tests.layouts.hostile_site import ATTACK, NOTHING, hostile_site
from tests.pages import browser_page, changed, coloured, settled

pytestmark = pytest.mark.browser

EVIL = "evil.example"
VALUES = "() => `${[...document.querySelectorAll('[role=slider]')].map((s) => s.ariaValueNow)}`"
SMALL = {"width": 640, "height": 120}  # pixels; quickly drawn
BLUE, ORANGE = (0, 114, 178), (213, 94, 0)  # of left and right
DARK = (30, 30, 30)  # of so100's motors
BELOW_NOTICE = slice(190, 420)  # pixels; the browser says above that it has no graphics card
CELL = ("face_to_face", "left=panda_wristcam", "right=so100", "--spacing", "0.5")


def reach_is_drawn(picture) -> bool:
    return coloured(picture, BLUE) > 300 and coloured(picture, ORANGE) > 150


def reddish(picture) -> int:
    red, green, blue = picture.transpose(2, 0, 1)
    return int((red - (green + blue) / 2 > 40).sum())


@pytest.mark.long
def test_robots_are_shown_moved_and_checked(tmp_path):
    with served("layouts", "view", *CELL, "--port", "0") as view, browser_page() as (page, asked):
        page.goto(view.url)
        start = settled(page, reach_is_drawn)
        page.screenshot(path=tmp_path / "start.png")
        page.get_by_text("No robot touches another or itself.").wait_for()

        page.get_by_label("Meshes").click()
        bare = settled(page, lambda now: changed(now, start) > 1500)
        page.get_by_label("Meshes").click()
        assert changed(settled(page, lambda now: changed(now, bare) > 1500), start) < 50

        page.get_by_label("Collision shapes").click()
        settled(page, lambda now: changed(now, start) > 1500)
        page.get_by_label("Collision shapes").click()
        page.get_by_label("Reach, circle").click()
        settled(page, lambda now: coloured(now, BLUE) < 50)
        page.get_by_label("Reach, circle").click()

        shoulder = page.get_by_role("slider").nth(1)
        shoulder.focus()
        shoulder.press("End")
        page.get_by_text("in right.").first.wait_for()
        assert "left.panda" in page.inner_text("body")
        moved = settled(page, lambda now: changed(now, start) > 1500)
        page.screenshot(path=tmp_path / "moved.png")
        assert reddish(moved) > reddish(start) + 150
        page.get_by_role("button", name="Back to the start").first.click()
        page.get_by_text("No robot touches another or itself.").wait_for()
        assert changed(settled(page), start) < 50

        at = urlsplit(view.url).netloc
        assert {urlsplit(address.removeprefix("blob:")).netloc for address in asked} <= {at, ""}
        status, rest = view.interrupt()
        assert status == 0
        assert rest == "ended\n"


@pytest.mark.long
def test_a_saved_page_shows_the_robots_and_asks_for_nothing(tmp_path):
    file = tmp_path / "cell.html"
    words = ["face_to_face", "left=so100", "right=so100", "--spacing", "0.5"]  # quickly drawn
    assert main(["view", *words, "--html", str(file)]) == 0
    with browser_page() as (page, asked):
        page.goto(file.as_uri())
        start = settled(page, reach_is_drawn)
        page.screenshot(path=tmp_path / "saved.png")
        assert page.title() == "face_to_face left=so100 right=so100"
        page.get_by_role("button", name="Show scene tree").last.click()
        page.locator('[data-scene-node="/left"] .tabler-icon-eye').click()
        alone = settled(page, lambda now: coloured(now, BLUE) < 50 and coloured(now, ORANGE) > 150)
        page.screenshot(path=tmp_path / "hidden.png")
        both, one = (coloured(shown[BELOW_NOTICE], DARK) for shown in (start, alone))
        assert both > one + 40 > 140
        assert asked == [file.as_uri()]


@pytest.mark.long
@pytest.mark.parametrize("names", [("127.0.0.1",), ("127.0.0.1", "localhost", EVIL)])
def test_only_the_page_with_the_token_steers(names):
    rebound = f"--host-resolver-rules=MAP {EVIL} 127.0.0.1"
    with (
        served("layouts", "view", "single", "arm=so100", "--port", "0") as view,
        hostile_site() as (hostile_port, received),
        running_browser(*SOFTWARE_WEBGL, rebound) as browser,
    ):
        context = browser.new_context(viewport=SMALL)
        context.set_default_timeout(1000 * PATIENCE)
        steers = context.new_page()
        steers.goto(view.url)
        steers.get_by_text("No robot touches another or itself.").wait_for()
        before = slider_values(steers)
        port, token = urlsplit(view.url).port, view.url.partition("token=")[2]
        protocol = f"viser-v{viser.__version__}"
        for host in names:
            hostile = context.new_page()
            hostile.goto(f"http://{host}:{hostile_port}/")
            for named in names:
                for query in ("", f"?token={token}"):
                    there = f"{named}:{port}/{query}"
                    addresses = [f"http://{there}", f"ws://{there}", protocol]
                    outcome = hostile.evaluate(ATTACK, addresses)
                    assert set(outcome.values()) <= set(NOTHING), (host, there, outcome)
            hostile.close()
        assert token not in "".join(received)
        rebound_page = context.new_page()
        for query in ("", f"?token={token}"):
            rebound_page.goto(f"http://{EVIL}:{port}/{query}")
            assert rebound_page.inner_text("body").startswith("This page opens only at the address")
        assert slider_values(steers) == before

        steers.get_by_role("slider").nth(1).press("End")
        moved = slider_values(steers)
        assert moved != before
        steers.goto("about:blank")  # draws no more, which is slow
        second = context.new_page()
        second.goto(view.url)
        second.wait_for_function(f"values => ({VALUES})() == values", arg=moved)
        second.reload()
        second.wait_for_function(f"values => ({VALUES})() == values", arg=moved)
        assert view.interrupt() == (0, "ended\n")


def slider_values(page):
    return page.evaluate(VALUES)
