"""``python -m parity report``: the page, in a real browser, and what it refuses."""

import copy
import json
import re
import shlex
import time
from collections.abc import Iterator
from pathlib import Path

import imageio.v2 as imageio
import numpy as np
import pytest

import tasks
from measurements.browser import PATIENCE, running_browser
from parity.__main__ import main
from parity.compare.results import RESULTS, read
from parity.report.figures import COLUMNS, RECORDED_COLUMNS, UNKNOWN, cells, is_verified, tiles
from parity.report.gaps import grouped
from parity.show.embedding import ClipError, fit, poster, share, size
from parity.sweep.entries import SUMMARY, blank, write_summary
from robot_layouts.__main__ import PROGRAM

DESKTOP, PHONE = (1280, 900), (390, 844)
INJECTION = '</p><script>document.title = "taken over"</script><img src=x onerror=alert(1)>'
VERIFIED, RANDOM, FAILED, DIFFERENT = "PickCube-v1", "PushT-v1", "RollBall-v1", "StackCube-v1"


def a_clip(**changes) -> dict:
    return {
        "task": VERIFIED,
        "seed": 3,
        "source": "trajectory.h5",
        "steps": 19,
        "native_success": True,
        "our_success": True,
        "success_step": 17,
        "max_state_difference": 0.0,
        "frames": 20,
        "differing_frames": 0,
        "mean_pixel_difference": 0.0,
        "max_pixel_difference": 0,
        "live_difference": 0.0,
        "panel_size": 64,
        "difference_gain": 8.0,
        "clip": "side_by_side.mp4",
        "sheet": "side_by_side.png",
        **changes,
    }


def an_entry(task_id: str, **changes) -> dict:
    entry = blank(task_id, {"demos": [], "episodes": 3, "video": True})
    entry |= {"equal": True, "source": "demonstrations"}
    entry["agreement"] = {
        "episodes": 3,
        "equal": 3,
        "steps": 60,
        "contact_steps": 9,
        "same_success": 3,
        "native_success": 2,
        "our_success": 2,
        "max_difference": 0.0,
        "differing": [],
    }
    entry["rollout"] = {
        "source": "a demos/trajectory.h5",
        "seed": 3,
        "steps": 19,
        "native_success": True,
        "our_success": True,
        "max_difference": 0.0,
        "arrays": 20,
    }
    return entry | changes


def entries() -> dict[str, dict]:
    """One task of each kind: verified, without a clip, failed, and different."""
    different = an_entry(DIFFERENT, equal=False)
    different["agreement"] |= {"equal": 2, "our_success": 1, "max_difference": 2.5e-6}
    different["agreement"]["differing"] = [{"seed": 4, "where": "from step 7 in qpos of panda"}]
    different["clip"] = a_clip(
        task=DIFFERENT,
        steps=51,
        our_success=False,
        max_state_difference=2.5e-6,
        differing_frames=6,
        mean_pixel_difference=0.25,
    )
    failed = blank(FAILED, {}) | {"error": f"it broke {INJECTION}"}
    return {
        VERIFIED: an_entry(VERIFIED, clip=a_clip()),
        RANDOM: an_entry(RANDOM, source="random", no_clip="there is no demonstration"),
        FAILED: failed,
        DIFFERENT: different,
    }


def write_clip(path: Path, frames: int = 20, width: int = 208, *, noise: bool = False) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(0)
    with imageio.get_writer(path, fps=20, quality=10 if noise else 6) as writer:
        for number in range(frames):
            picture = np.full((80, width, 3), 40, np.uint8)
            picture[20:60, number * 4 : number * 4 + 30] = (200, 90, 30)
            if noise:
                picture = rng.integers(0, 256, picture.shape, np.uint8)
            writer.append_data(picture)
    return path


def write_runs(folder: Path, found: dict[str, dict], **options) -> Path:
    for task_id, entry in found.items():
        if entry["clip"]:
            write_clip(folder / task_id / "side_by_side.mp4", **options)
    write_summary(folder / SUMMARY, found)
    return folder


def report(runs: Path, out: Path, *options: str) -> int:
    return main(["report", "--runs", str(runs), "--out", str(out), *options])


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return write_runs(tmp_path_factory.mktemp("runs"), entries())


@pytest.fixture(scope="module")
def page_file(runs, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "report.html"
    assert report(runs, path) == 0
    return path


@pytest.fixture(scope="module")
def browser():
    with running_browser("--disable-gpu") as chromium:
        yield chromium


class Visit:
    """A page that is open in a browser, and everything it said and asked for."""

    def __init__(self, browser, file: Path, window=DESKTOP, **options) -> None:
        width, height = window
        self.context = browser.new_context(viewport={"width": width, "height": height}, **options)
        self.page = self.context.new_page()
        self.page.set_default_timeout(1000 * PATIENCE)
        self.note: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda message: self.note.append(message.text))
        self.page.on("pageerror", lambda error: self.note.append(str(error)))
        self.page.on("dialog", lambda dialog: self.note.append(dialog.message))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(file.as_uri())


@pytest.fixture
def visit(browser, page_file) -> Iterator:
    visits: list[Visit] = []

    def go(window=DESKTOP, **options) -> Visit:
        visits.append(Visit(browser, page_file, window, **options))
        return visits[-1]

    yield go
    for one in visits:
        one.context.close()


def rows_of(page) -> list[list[str]]:
    return page.eval_on_selector_all(
        "tbody tr", "rows => rows.map(row => [...row.cells].map(cell => cell.innerText.trim()))"
    )


def scroll_all(page) -> None:
    """Look at the whole page, so that whatever is loaded late is loaded."""
    page.evaluate(
        "async () => { for (let y = 0; y < document.body.scrollHeight; y += 600) {"
        " scrollTo(0, y); await new Promise(done => setTimeout(done, 30)); } }"
    )


WIDTHS = "[document.scrollingElement.scrollWidth, innerWidth]"
PLAYING = "v => v.readyState >= 2 && v.videoWidth > 0 && !v.paused && v.currentTime > 0.3"


@pytest.mark.long
class TestInABrowser:
    pytestmark = [pytest.mark.browser, pytest.mark.xdist_group("page")]  # they share one browser

    def test_it_says_nothing_and_asks_for_nothing(self, visit, page_file):
        visited = visit()
        scroll_all(visited.page)
        visited.page.wait_for_timeout(300)
        assert visited.note == []
        assert visited.asked[0] == page_file.as_uri()
        assert {url.split(":")[0] for url in visited.asked} <= {"file", "data"}
        assert [url for url in visited.asked if url.startswith("file")] == [page_file.as_uri()]
        assert visited.page.title() == "robot-layouts beside native ManiSkill"

    def test_the_table_is_the_summary(self, visit, runs):
        swept = json.loads((runs / SUMMARY).read_text())["tasks"]
        recorded = read(RESULTS)["tasks"]
        rows = rows_of(visit().page)
        assert [row[0].split()[0] for row in rows] == list(tasks.list_clones())
        for first, *shown in rows:
            task_id = first.split()[0]
            known = recorded[task_id]
            worst = max(map(float, known["max_difference"].values()))
            assert shown[:3] == [f"{known[k]:,}" for k in ("episodes", "steps", "contact_steps")]
            assert (shown[3] == shown[4] == "0") == (worst == 0)
            assert shown[5] == f"{known['success']['native']} / {known['success']['ours']}"
            if not (entry := swept.get(task_id)) or not entry["agreement"]:
                assert shown[RECORDED_COLUMNS:] == [UNKNOWN] * 6
                continue
            agreement, clip = entry["agreement"], entry["clip"]
            assert shown[6] == entry["source"]
            assert shown[7] == f"{agreement['equal']} / {agreement['episodes']}"
            assert shown[8] == f"{agreement['native_success']} / {agreement['our_success']}"
            assert float(shown[9]) == agreement["max_difference"]
            if clip is None:
                assert shown[10:] == [UNKNOWN, UNKNOWN]
            else:
                assert float(shown[10]) == clip["mean_pixel_difference"]
                assert shown[11] == f"{clip['differing_frames']} of {clip['frames']}"

    def test_a_clip_plays_when_it_is_seen_and_stops_when_not(self, visit):
        page = visit().page
        video = page.locator(f"#{VERIFIED} video")
        assert video.evaluate("v => v.paused && v.readyState === 0")
        video.scroll_into_view_if_needed()
        page.wait_for_function(PLAYING, arg=video.element_handle())
        assert video.evaluate("v => [v.videoWidth, v.videoHeight]") == [208, 80]
        assert video.evaluate("v => v.muted && v.playsInline && v.controls && v.error === null")
        page.evaluate("scrollTo(0, 0)")
        page.wait_for_function("v => v.paused", arg=video.element_handle())

    def test_what_the_reader_stopped_stays_stopped(self, visit):
        page = visit().page
        video = page.locator(f"#{VERIFIED} video")
        video.scroll_into_view_if_needed()
        page.wait_for_function(PLAYING, arg=video.element_handle())
        video.evaluate("v => v.pause()")
        page.evaluate("scrollTo(0, 0)")
        page.wait_for_timeout(200)
        video.scroll_into_view_if_needed()
        page.wait_for_timeout(500)
        assert video.evaluate("v => v.paused")

    def test_nothing_plays_by_itself_for_who_asked_for_less_motion(self, visit):
        page = visit(reduced_motion="reduce").page
        video = page.locator(f"#{VERIFIED} video")
        video.scroll_into_view_if_needed()
        page.wait_for_timeout(500)
        assert video.evaluate("v => v.paused")

    def test_a_browser_that_plays_no_data_address(self, visit):
        page = visit().page
        video = page.locator(f"#{VERIFIED} video")
        video.evaluate("v => v.dispatchEvent(new Event('error'))")
        assert video.get_attribute("src").startswith("blob:")
        video.scroll_into_view_if_needed()
        page.wait_for_function(PLAYING, arg=video.element_handle())

    def test_without_scripts_everything_is_there(self, visit):
        page = visit(java_script_enabled=False).page
        assert page.locator("tbody tr").count() == len(tasks.list_clones())
        assert page.locator("video[controls][poster]").count() == 2
        assert page.locator("#filter").is_hidden()
        assert page.get_by_role("heading", name="What is missing").is_visible()
        page.locator(f"#{VERIFIED} summary").click()
        assert page.locator(f"#{VERIFIED} pre").is_visible()

    def test_on_a_desktop_the_table_is_seen_whole(self, visit):
        box = visit().page.locator(".scroll")
        assert box.evaluate("b => b.scrollWidth <= b.clientWidth")

    @pytest.mark.parametrize("window", [PHONE, DESKTOP, (320, 640), (820, 1180)])
    def test_nothing_is_wider_than_the_window(self, visit, window):
        page = visit(window).page
        page.evaluate("document.querySelectorAll('details').forEach(d => { d.open = true; })")
        scrolled, inner = page.evaluate(WIDTHS)
        assert inner == window[0]
        assert scrolled <= inner
        too_wide = page.evaluate(
            "[...document.querySelectorAll('p, li, h1, h2, h3, figure, video, figcaption, pre, nav,"
            " .scroll')].filter(e => e.getBoundingClientRect().right > innerWidth + 0.5)"
            ".map(e => e.outerHTML.slice(0, 80))"
        )
        assert too_wide == []

    def test_on_a_phone_the_table_scrolls_in_its_box_and_keeps_the_names(self, visit):
        page = visit(PHONE).page
        box, name = page.locator(".scroll"), page.locator("tbody th").first
        left = name.bounding_box()["x"]
        assert box.evaluate("b => b.scrollWidth > b.clientWidth")
        box.evaluate("b => { b.scrollLeft = 400; }")
        assert box.evaluate("b => b.scrollLeft") == 400
        assert abs(name.bounding_box()["x"] - left) < 2

    def test_sorting(self, visit):
        page = visit().page
        column = [c.name for c in COLUMNS].index("steps") + 1
        button = page.get_by_role("button", name="steps", exact=True)

        def steps() -> list[int]:
            return [int(row[column].replace(",", "")) for row in rows_of(page)]

        button.click()
        assert steps() == sorted(steps())
        assert len(steps()) == len(tasks.list_clones())
        button.press("Enter")
        assert steps() == sorted(steps(), reverse=True)
        heading = page.get_by_role("columnheader", name="steps", exact=True)
        assert heading.get_attribute("aria-sort") == "descending"
        page.get_by_role("button", name="task", exact=True).click()
        assert [row[0].split()[0] for row in rows_of(page)] == sorted(tasks.list_clones())

    def test_what_was_not_measured_is_sorted_last(self, visit):
        page = visit().page
        button = page.get_by_role("button", name="episodes equal")
        for _ in range(2):
            button.click()
            cells = [row[8] for row in rows_of(page)]
            assert UNKNOWN not in cells[:3]
            assert set(cells[3:]) == {UNKNOWN}

    def test_filtering(self, visit):
        page = visit().page
        page.get_by_label("Show tasks with").fill("panda_stick")
        shown = page.locator("tbody tr:visible")
        assert {text.split()[0] for text in shown.all_inner_texts()} == {
            "DrawTriangle-v1",
            "PushT-v1",
        }
        assert page.get_by_role("status").inner_text() == f"2 of {len(tasks.list_clones())}"

    def test_by_keyboard(self, visit):
        page = visit().page
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.textContent") == "Skip to the table"
        page.keyboard.press("Enter")
        page.wait_for_url("**#table")
        page.locator(".scroll").focus()
        assert page.evaluate("document.activeElement.matches('.scroll')")

    def test_headings_and_names(self, visit):
        page = visit().page
        levels = page.eval_on_selector_all("h1, h2, h3, h4", "h => h.map(e => +e.tagName[1])")
        assert levels.count(1) == 1
        assert all(b - a <= 1 for a, b in zip(levels, levels[1:], strict=False))
        for video in page.locator("video").all():
            assert "side by side" in video.get_attribute("aria-label")
        assert page.locator("img").count() == 0
        assert page.locator("html").get_attribute("lang") == "en"
        ids = page.eval_on_selector_all("[id]", "all => all.map(e => e.id)")
        assert len(ids) == len(set(ids))
        links = page.eval_on_selector_all("a", "all => all.map(e => e.getAttribute('href'))")
        assert {link.removeprefix("#") for link in links} <= set(ids)

    @pytest.mark.parametrize("scheme", ["light", "dark"])
    def test_words_stand_out_from_the_ground(self, visit, scheme):
        page = visit(color_scheme=scheme).page
        ground = colour(page, "body", "backgroundColor")
        assert (luminance(ground) > 0.5) == (scheme == "light")
        for selector in ("body", ".lead", ".note", "a", ".bad", ".status.good", "figcaption"):
            assert contrast(colour(page, selector, "color"), ground) >= 4.5, selector

    def test_what_a_task_said_is_text(self, visit):
        visited = visit()
        assert visited.page.title() != "taken over"
        assert visited.page.locator(f"#{FAILED} .problem").inner_text().endswith(INJECTION)
        assert visited.page.locator("img").count() == 0
        assert visited.note == []

    def test_foreign_scripts_are_refused(self, browser, page_file, tmp_path):
        path = tmp_path / "page.html"
        added = "<script>document.title = 'taken over'</script><img src='http://localhost:9/x.png'>"
        path.write_text(page_file.read_text().replace("</main>", f"{added}</main>"))
        visited = Visit(browser, path)
        deadline = time.monotonic() + PATIENCE
        while len(visited.note) < 2 and time.monotonic() < deadline:
            visited.page.wait_for_timeout(100)
        assert visited.page.title() != "taken over"
        assert sum("Content Security Policy" in said for said in visited.note) == 2
        visited.context.close()

    def test_what_is_missing_is_said(self, visit):
        page = visit().page
        text = page.locator("#missing").inner_text()
        assert f"{RANDOM} — there is no demonstration" in text
        assert "TwoRobotStackCube-v1 — not swept" in text
        assert "it broke" in text
        assert "seed 4 differs from step 7 in qpos of panda" in text.lower()
        assert "the clone does not succeed; 6 of 20 frames differ" in text
        unverified = re.split(r"[\s,]+", text.split("without a scripted expert")[0])
        assert VERIFIED not in unverified
        assert RANDOM in unverified

    def test_what_a_clip_shows_is_said(self, visit):
        page = visit().page
        assert page.locator(f"#{VERIFIED} figcaption").inner_text() == (
            "Seed 3, 19 steps of trajectory.h5: native succeeds and the clone succeeds;"
            " all 20 frames equal in every pixel; max |Δ| of the state 0."
        )
        assert page.locator(f"#{DIFFERENT} figcaption").inner_text() == (
            "Seed 3, 51 steps (the task allows 50) of trajectory.h5: native succeeds and the clone"
            " does not succeed; 6 of 20 frames differ, mean pixel difference 0.25 of 255;"
            " max |Δ| of the state 2.5e-06."
        )
        assert page.locator(f"#{RANDOM} .absent").inner_text() == (
            "No clip. There is no demonstration."
        )

    def test_how_to_reproduce_a_task(self, visit):
        page = visit().page
        page.locator(f"#{VERIFIED} summary").click()
        lines = page.locator(f"#{VERIFIED} pre").inner_text().splitlines()
        assert lines[0] == f"robot-layouts parity compare --task {VERIFIED} --seeds 10 --steps 100"
        assert "--demo 'a demos/trajectory.h5' --seed 3" in lines[-1]
        for line in lines:
            name, *words = shlex.split(line)
            assert name == "robot-layouts"
            PROGRAM.parse(words)

    def test_headline_figures(self, visit):
        page = visit().page
        found = dict(
            zip(
                page.locator(".tile dt").all_inner_texts(),
                page.locator(".tile .value").all_inner_texts(),
                strict=True,
            )
        )
        recorded, count = read(RESULTS)["tasks"], len(tasks.list_clones())
        assert found["tasks equal to native"] == (
            f"{sum(result['equal'] for result in recorded.values())} of {count}"
        )
        assert found["replayed episodes equal"] == "8 of 9"
        assert found["verified clips"] == f"1 of {count}"


def colour(page, selector: str, which: str) -> tuple[float, ...]:
    text = page.locator(selector).first.evaluate(f"e => getComputedStyle(e).{which}")
    return tuple(int(number) / 255 for number in re.findall(r"\d+", text)[:3])


def luminance(rgb: tuple[float, ...]) -> float:
    """Relative luminance as WCAG 2 defines it."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in rgb]
    return sum(part * c for part, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def contrast(first: tuple[float, ...], second: tuple[float, ...]) -> float:
    darker, lighter = sorted((luminance(first), luminance(second)))
    return (lighter + 0.05) / (darker + 0.05)


class TestSize:
    @pytest.mark.long
    def test_clips_are_made_to_fit(self, tmp_path, capsys):
        runs = write_runs(tmp_path / "runs", entries(), frames=40, noise=True)
        large, small = tmp_path / "large.html", tmp_path / "small.html"
        assert report(runs, large) == 0
        limit = large.stat().st_size / 1e6 * 0.6
        assert report(runs, small, "--limit", f"{limit}") == 0
        assert small.stat().st_size <= limit * 1e6 < large.stat().st_size
        assert small.read_text().count("data:video/mp4") == 2
        assert re.search(r"small\.html: \d+\.\d MB", capsys.readouterr().out)

    def test_what_cannot_fit_is_refused(self, runs, tmp_path, capsys):
        out = tmp_path / "report.html"
        assert report(runs, out, "--limit", "0.02") == 2
        said = capsys.readouterr().err
        assert said.startswith("error: the page does not fit into 0.02 MB (")
        assert "give a larger --limit, or fewer tasks" in said
        assert not list(tmp_path.iterdir())

    def test_room_that_small_clips_leave_goes_to_large_ones(self):
        a, b, c = Path("a"), Path("b"), Path("c")
        assert share({a: 10, b: 500, c: 900}, 610) == {a: 10, b: 300, c: 300}
        assert share({a: 10, b: 20, c: 30}, 1000) == {a: 10, b: 20, c: 30}

    def test_a_clip_that_fits_stays_as_it_is(self, tmp_path):
        path = write_clip(tmp_path / "clip.mp4")
        assert fit(path, path.stat().st_size) == path.read_bytes()
        assert size(path) == (208, 80)

    def test_the_poster_is_the_last_picture(self, tmp_path):
        picture = imageio.imread(poster(write_clip(tmp_path / "clip.mp4")), format="jpeg")
        assert picture.shape == (80, 208, 3)
        assert picture[40, 90].astype(int)[0] > 150  # where the block has gone
        assert picture[40, 10].astype(int)[0] < 80  # where it was

    @pytest.mark.parametrize("take", [poster, size, lambda path: fit(path, 3)])
    def test_what_is_no_clip(self, take, tmp_path):
        path = tmp_path / "clip.mp4"
        path.write_bytes(b"no video")
        with pytest.raises(ClipError, match=re.escape(str(path))):
            take(path)


class TestRefusals:
    def test_no_sweep(self, tmp_path, capsys):
        assert report(tmp_path, tmp_path / "report.html") == 2
        assert "`robot-layouts parity sweep` writes it" in capsys.readouterr().err

    def test_a_clip_that_is_gone(self, tmp_path, capsys):
        runs = write_runs(tmp_path, {VERIFIED: an_entry(VERIFIED, clip=a_clip())})
        (runs / VERIFIED / "side_by_side.mp4").unlink()
        assert report(runs, tmp_path / "report.html") == 2
        assert "side_by_side.mp4 is gone" in capsys.readouterr().err

    def test_a_folder_in_the_way(self, runs, tmp_path, capsys):
        assert report(runs, tmp_path) == 2
        assert capsys.readouterr().err.startswith(f"error: cannot write {tmp_path}")
        assert not list(tmp_path.glob("*.partial"))


class TestFigures:
    def test_every_column_has_a_figure(self):
        result = read(RESULTS)["tasks"][VERIFIED]
        for entry in (None, blank(VERIFIED, {}), *entries().values()):
            for record in (None, result):
                assert len(cells(entry, record)) == len(COLUMNS)

    def test_a_difference_is_never_shown_as_none(self):
        result = copy.deepcopy(read(RESULTS)["tasks"][VERIFIED])
        result["max_difference"]["qvel"] = 1e-30
        result["reward"]["sparse"] = "inf"
        result["success"]["ours"] += 1
        _, _, _, state, rest, success, *_ = cells(None, result)
        assert (state.text, rest.text) == ("1.0e-30", "inf")
        assert state.bad
        assert rest.bad
        assert success.bad

    def test_verified_is_success_on_both_sides_and_no_difference(self):
        assert is_verified(an_entry(VERIFIED, clip=a_clip()))
        assert not is_verified(None)
        assert not is_verified(an_entry(VERIFIED))
        for change in (
            {"native_success": False},
            {"our_success": False},
            {"differing_frames": 1},
            {"max_state_difference": 1e-30},
        ):
            assert not is_verified(an_entry(VERIFIED, clip=a_clip(**change)))

    def test_headlines_of_nothing(self):
        found = {tile.label: tile.value for tile in tiles({VERIFIED: None}, {})}
        assert found["tasks equal to native"] == "0 of 1"
        assert found["replayed episodes equal"] == "0 of 0"

    def test_same_reasons_stand_together(self):
        one, two = grouped([("a", "x"), ("b", "y"), ("c", "x")])
        assert (one.names, one.why) == (("a", "c"), "x")
        assert (two.names, two.why) == (("b",), "y")
