"""``python -m measurements.gallery``: pages are complete, fresh, and say what records say."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from math import radians, tan
from pathlib import Path

import numpy as np
import pytest

from measurements.bench import tables as bench_tables
from measurements.bench.measurement import number_text
from measurements.gallery import __main__ as command
from measurements.gallery.camera import BACKGROUND, Lens, shrunk
from measurements.gallery.clip import LONGEST, speed, steps_per_frame
from measurements.gallery.markdown import clip_path, portrait_path, robot_path, task_path
from measurements.gallery.pages import all_pages, complaints, write_pages
from measurements.gallery.pictures import LARGEST_CLIP, LARGEST_PORTRAIT
from measurements.gallery.record import Entry, ExpertRecord, GalleryError, Record, TaskRecord
from measurements.gallery.sources import kind, robots, task_classes
from parity.compare import results

GALLERY = Path(__file__).parents[2] / "docs" / "gallery"
LARGEST_GALLERY = 8_000_000  # bytes
LINK = re.compile(r"\]\(([^)#]+)\)")
PICTURE = re.compile(r"!\[([^]]*)\]")


@pytest.fixture(scope="module")
def record() -> Record:
    return Record.read()


@pytest.fixture(scope="module")
def pages(record) -> dict[str, str]:
    return all_pages(record, GALLERY)


@pytest.fixture
def copy(tmp_path) -> Path:
    """Return a copy of the gallery."""
    return Path(shutil.copytree(GALLERY, tmp_path / "gallery"))


class TestCommitted:
    @pytest.mark.long
    def test_pages_are_fresh(self, capsys):
        assert command.main(["--check"]) == 0, capsys.readouterr().err

    def test_every_task_and_robot_has_a_page_and_a_picture(self):
        wanted = {f(name) for f in (task_path, clip_path) for name in task_classes()}
        wanted |= {f(name) for f in (robot_path, portrait_path) for name in robots()}
        assert not {path for path in wanted if not (GALLERY / path).is_file()}

    def test_links_resolve(self):
        for page in GALLERY.rglob("*.md"):
            links = LINK.findall(page.read_text(encoding="utf-8"))
            assert links
            assert not [link for link in links if not (page.parent / link).is_file()], page

    def test_every_picture_says_in_words_what_it_shows(self):
        for page in GALLERY.rglob("*.md"):
            found = PICTURE.findall(page.read_text(encoding="utf-8"))
            assert found, page
            assert all(len(words.split()) > 2 for words in found), page

    def test_pictures_are_small(self):
        for folder, limit in (("robots", LARGEST_PORTRAIT), ("tasks", LARGEST_CLIP)):
            for path in (GALLERY / "media" / folder).iterdir():
                assert path.stat().st_size <= limit, path
        files = (path for path in GALLERY.rglob("*") if path.is_file())
        assert sum(path.stat().st_size for path in files) <= LARGEST_GALLERY


class TestCheck:
    @pytest.mark.long
    def test_tells_what_was_altered(self, record, copy):
        (copy / "tasks" / "PickCube-v1.md").write_text("changed")
        (copy / "robots" / "panda.md").unlink()
        (copy / "robots" / "nobody.md").touch()
        (copy / "media" / "robots" / "so100.webp").unlink()
        (copy / "media" / "tasks" / "Nothing-v1.webp").touch()
        robots = {**record.robots, "koch": replace(record.robots["koch"], urdf_sha256="0" * 64)}
        told = list(complaints(Record(robots, record.tasks), copy))
        for expected in (
            "tasks/PickCube-v1.md is stale; run `python -m measurements.gallery`",
            "robots/panda.md is missing; run `python -m measurements.gallery`",
            "robots/nobody.md is of no task or robot",
            "media/robots/so100.webp is missing; run `.* --pictures so100`",
            "media/tasks/Nothing-v1.webp is of no task or robot; remove it",
            "the URDF of koch has changed; run `.* --measure koch`",
        ):
            assert any(re.match(expected, line) for line in told), expected
        # The page of a robot, and the cards, show no picture that there is not.
        stale = {line.split()[0] for line in told if " is stale" in line}
        assert stale == {"tasks/PickCube-v1.md", "robots/so100.md", "index.md"}

    @pytest.mark.long
    def test_fails_when_a_page_was_altered(self, copy, monkeypatch, capsys):
        monkeypatch.setattr(command, "FOLDER", copy)
        (copy / "index.md").write_text("changed")
        assert command.main(["--check"]) == 1
        assert "index.md is stale; run `python -m measurements.gallery`" in capsys.readouterr().err

    def test_unknown_name(self, capsys):
        assert command.main(["--pictures", "pandda"]) == 2
        assert "Did you mean 'panda'?" in capsys.readouterr().err


@pytest.mark.long
def test_writing_removes_pages_of_nothing(record, copy):
    (copy / "tasks" / "Gone-v1.md").touch()
    count = write_pages(record, copy)
    assert len(list(copy.rglob("*.md"))) == count == 1 + len(task_classes()) + len(robots())


class TestFigures:
    def test_of_the_experts(self, record, pages):
        for task_id in task_classes():
            expert = record.task(task_id).expert
            assert f"{expert.solved} of {expert.episodes} episodes" in pages[task_path(task_id)]

    def test_of_the_comparison(self, pages):
        for task_id, found in results.read()["tasks"].items():
            page = pages[task_path(task_id)]
            assert f"{found['episodes']} episodes, {found['steps']:,} steps" in page
            assert f"**Observation:** {found['observation_size']} numbers" in page

    def test_of_the_benchmarks(self, pages):
        step = bench_tables.read().find("step")
        for task_id in step.values:
            cells = [number_text(step.median(name, task_id)) for name in step.samples]
            assert f"| {' | '.join(cells)} |" in pages[task_path(str(task_id))]

    def test_every_joint_of_a_robot_is_on_its_page(self, pages):
        for name, robot in robots().items():
            assert all(f"| `{joint}` |" in pages[robot_path(name)] for joint in robot.joints)

    def test_robots_are_told_apart(self):
        kinds = {name: kind(robot) for name, robot in robots().items()}
        known = {"panda": "arm", "baxter": "several arms", "talos": "humanoid", "dclaw": "hand"}
        assert {name: kinds[name] for name in known} == known


class TestRecord:
    def test_is_what_was_written(self, record, tmp_path):
        record.write(tmp_path / "record.json")
        assert Record.read(tmp_path / "record.json") == record

    def test_what_is_missing_is_named_with_the_command(self):
        with pytest.raises(GalleryError, match="no robot 'panda'; run `.* --measure panda`"):
            Record().robot("panda")

    @pytest.mark.parametrize("text", ["", "[]", '{"robots": {"a": 1}, "tasks": {}}'])
    def test_no_record(self, text, tmp_path):
        (tmp_path / "record.json").write_text(text)
        with pytest.raises(GalleryError, match="--measure` writes it"):
            Record.read(tmp_path / "record.json")

    def test_the_first_seed_that_was_solved(self):
        expert = ExpertRecord(3, {"0": "dropped", "2": "late"}, (5, 7, 9), {})
        assert (expert.solved, expert.first_solved, expert.solved_steps) == (1, 1, [7])
        with pytest.raises(GalleryError, match="solved no episode"):
            _ = ExpertRecord(1, {"0": "dropped"}, (5,), {}).first_solved

    def test_pages_need_every_task(self, record):
        tasks = {"PickCube-v1": TaskRecord((Entry("a", 1, True),), ExpertRecord(0, {}, (), {}))}
        with pytest.raises(GalleryError, match="the record has no task"):
            all_pages(Record(record.robots, tasks), GALLERY)


class TestCamera:
    def test_all_points_just_fit(self):
        points = np.random.default_rng(0).uniform(-1, [1, 2, 3], (200, 3))
        lens = Lens(radians(30), radians(20), radians(40), aspect=4 / 3, margin=0.1)
        x, y, z = lens.axes() @ (points - lens.fitted(points)).T
        slope = tan(lens.fov / 2) * 0.8
        shares = np.array([abs(x) / (z * slope * lens.aspect), abs(y) / (z * slope)])
        assert (z > 0).all()
        assert shares.max() == pytest.approx(1)

    def test_pixels_are_means_and_what_is_empty_is_background(self):
        rgb = np.full((2, 4, 3), 100, np.uint8)
        solid = np.zeros((2, 4, 1), bool)
        solid[:, 0] = True
        half = [(100 + b) / 2 for b in BACKGROUND]
        assert shrunk(rgb, solid, 2).tolist() == [[np.round(half).tolist(), list(BACKGROUND)]]


@pytest.mark.parametrize(("steps", "stride"), [(1, 2), (120, 2), (121, 3), (600, 10)])
def test_long_episodes_are_shown_faster(steps, stride):
    assert steps_per_frame(steps, 20) == stride
    assert speed(steps, 20) == stride / 2
    assert steps / 20 / speed(steps, 20) <= LONGEST


@pytest.mark.long
@pytest.mark.native  # because of the pictures
def test_a_portrait_fills_its_picture(renderer):
    from measurements.gallery.portrait import SIZE, Sitter

    picture = Sitter(robots()["panda"]).portrait()
    rows, columns = np.nonzero((picture != BACKGROUND).any(-1))
    edges = [rows.min(), columns.min(), SIZE - 1 - rows.max(), SIZE - 1 - columns.max()]
    assert min(edges) > 0.03 * SIZE
    assert min(rows.min(), columns.min()) < 0.08 * SIZE
