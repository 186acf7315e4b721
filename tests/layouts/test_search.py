"""`layouts.search`: where robots stand who have to reach something."""

import subprocess
import sys

import numpy as np
import pytest

import layouts
from layouts import ceiling, ring, search, table, wall
from layouts.__main__ import main
from layouts.layout import Layout
from layouts.placing.cost import requirements_of
from robots import LayoutError, MissingPackageError, RobotLayoutsError, RobotRegistry
from tests.layouts.small_robots import robot

PANDA = {"arm": "panda"}
PAIR = {"left": "panda", "right": "so100"}
CUBE = {"cube": (0.1, 0.0, 0.15)}  # m
QUICK = {"tries": 1, "clearance": 0.05}


def reached(layout, targets):
    report = layout.validate(targets=targets, workspaces=False)
    assert report.ok, str(report)
    places = 1000 * np.array([placement.position for placement in layout.values()])
    assert np.abs(places - places.round()).max() < 1e-9, "places are whole millimetres"
    return {(reach.target, reach.robot) for reach in report.reaches if reach.reached}


@pytest.fixture(scope="module")
def pair():
    return search(PAIR, CUBE, reached_by="all", **QUICK)


class TestResult:
    @pytest.mark.long
    def test_all_who_must_reach_a_target_do(self, pair):
        assert isinstance(pair, Layout)
        assert list(pair) == list(PAIR)
        assert reached(pair, CUBE) == {("cube", "left"), ("cube", "right")}

    @pytest.mark.long
    def test_robots_are_clear_of_each_other(self, pair):
        (clearance,) = pair.validate(workspaces=False).clearances
        assert clearance.noisy_distance >= QUICK["clearance"]

    @pytest.mark.long
    def test_they_share_more_than_in_a_ring(self, pair):
        (found,), (before,) = (layout.validate().shared for layout in (pair, ring(PAIR)))
        assert found.volume > 1.3 * before.volume

    @pytest.mark.long
    def test_another_process_gets_the_same(self, pair):
        code = (
            "from layouts import search; print(search("
            f"{PAIR}, {CUBE}, reached_by='all', tries=1, clearance=0.05).to_yaml(), end='')"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
        assert done.stdout.decode() == pair.to_yaml()


class TestWhoReaches:
    @pytest.mark.long
    def test_a_pose_of_one_robot(self):
        targets = {"cube": (0.4, 0.0, 0.1, 0.0, 1.0, 0.0, 0.0)}
        assert reached(search(PANDA, targets, **QUICK), targets) == {("cube", "arm")}

    @pytest.mark.long
    def test_each_limb_its_own(self):
        targets = {"here": (0.5, 0.3, 0.3), "there": (0.5, -0.3, 0.3)}
        by = {"here": "left", "there": ["torso.right"]}
        found = reached(search({"torso": "baxter"}, targets, reached_by=by, **QUICK), targets)
        assert {("here", "torso.left"), ("there", "torso.right")} <= found

    def test_what_is_asked_for(self):
        alone = ring({"torso": "baxter", "arm": "panda"})
        targets = {"a": (0, 0, 0), "b": (0, 0, 1), "c": (1, 0, 0), "d": (1, 1, 0)}
        by = {"a": "all", "b": ["arm", "right"], "c": "torso"}
        arms = [(asked.target, asked.arms) for asked in requirements_of(targets, by, alone)]
        left, right = "torso.left", "torso.right"
        assert arms == [
            *(("a", (arm,)) for arm in (left, right, "arm")),
            *(("b", (arm,)) for arm in ("arm", right)),
            ("c", (left, right)),
            ("d", (left, right, "arm")),
        ]

    def test_a_robot_from_a_urdf(self):
        path = RobotRegistry.load("xarm7").urdf.locate()
        assert reached(search({"arm": path}, CUBE, **QUICK), CUBE) == {("cube", "arm")}


class TestOutOfReach:
    FAR = {**CUBE, "moon": (0.0, 0.0, 3.0)}

    @pytest.mark.long
    def test_it_is_named_with_what_is_missing(self):
        with pytest.raises(
            LayoutError, match=r"wherever it stands: moon: arm stays 1\.\d\d m away"
        ):
            search(PANDA, self.FAR, **QUICK)

    @pytest.mark.long
    def test_it_may_be_left_out(self):
        layout = search(PANDA, self.FAR, partial=True, **QUICK)
        assert reached(layout, CUBE) == {("cube", "arm")}

    @pytest.mark.long
    def test_where_a_table_is(self):
        with pytest.raises(LayoutError, match="bin: arm would touch itself or a table there"):
            search(PANDA, {"bin": (0.0, 0.0, -0.1)}, around=table(1.2, 0.8), **QUICK)

    APART = {"west": (-2.0, 0.0, 0.2), "east": (2.0, 0.0, 0.2)}

    def test_two_that_no_place_serves(self):
        with pytest.raises(LayoutError, match="from which all targets are reached.*: arm stays"):
            search(PANDA, self.APART, **QUICK)

    def test_no_room(self):
        narrow = (-0.05, -0.05, 0.05, 0.05)
        with pytest.raises(LayoutError, match="less than the clearance of 20.0 cm"):
            search(dict.fromkeys("ab", "so100"), within=narrow, tries=1, clearance=0.2)


class TestGround:
    def test_a_tables_edges(self):
        layout = search(PAIR, CUBE, around=table(1.2, 0.8), **QUICK)
        assert reached(layout, CUBE)
        assert all(placement.on.startswith("table.") for placement in layout.values())
        assert {placement.position[0] for placement in layout.values()} == {0.1}  # from the edge
        assert layout.frames == table(1.2, 0.8)

    @pytest.mark.long
    def test_a_ceiling(self):
        layout = search(PANDA, CUBE, around={"roof": ceiling(1.1)}, **QUICK)
        assert reached(layout, CUBE)
        assert layout["arm"].on == "roof"
        assert layout["arm"].base_position[2] == pytest.approx(1.1)

    def test_a_wall(self):
        targets = {"button": (0.6, 0.0, 0.8)}
        layout = search(PANDA, targets, around=wall((0.0, 0.0, 0.8)), **QUICK)
        assert reached(layout, targets)
        assert layout["arm"].base_position[0] == pytest.approx(0.0)

    def test_an_area_that_bases_keep_out_of(self):
        area, room = (-0.3, -0.4, 0.3, 0.4), (-1.0, -1.0, 0.1, 1.0)
        layout = search(PANDA, CUBE, around=area, within=room, heights={"arm": 0.2}, **QUICK)
        x, y, z = layout["arm"].base_position
        assert not (-0.4 < x < 0.4 and -0.5 < y < 0.5)
        assert -1.0 <= x <= 0.1
        assert -1.0 <= y <= 1.0
        assert z == 0.2
        assert reached(layout, CUBE)


@pytest.mark.parametrize(
    ("robots", "options", "message"),
    [
        ({"a": "pnada"}, {}, "Did you mean 'panda'"),
        ("panda", {}, "robots is 'panda'; it takes a mapping"),
        ({}, {}, "at least one robot"),
        (PANDA, {"targets": 5}, "targets is 5; it takes places"),
        (PANDA, {"targets": [(0, 0)]}, r"target 'target 1' is \(0, 0\)"),
        (PANDA, {"around": (1, 2, 3)}, "around is .* frames by name"),
        (PANDA, {"around": "table"}, "around is 'table'"),
        (PANDA, {"around": {}}, r"around is \{\}"),
        (PANDA, {"around": (1, 1, 0, 0)}, "must be x_min, y_min, x_max, y_max"),
        (PANDA, {"around": table(1, 1), "within": (0, 0, 1, 1)}, "along the edges of table"),
        (PANDA, {"around": (-1, -1, 1, 1), "within": (0, 0, 0.5, 0.5)}, "no room around"),
        (PANDA, {"within": (0, 0)}, "within"),
        (PANDA, {"reached_by": {"cub": "arm"}}, "unknown target 'cub'. Did you mean 'cube'"),
        (PANDA, {"reached_by": "amr"}, "Did you mean 'arm'"),
        (PANDA, {"reached_by": 3}, "reached_by is 3; it takes 'any', 'all'"),
        (PANDA, {"reached_by": []}, r"reached_by is \[\]"),
        (PANDA, {"heights": {"amr": 1}}, "Did you mean 'arm'"),
        (PANDA, {"heights": "high"}, "heights is 'high'"),
        (PANDA, {"keyframe": "rst"}, "Did you mean 'rest'"),
        (PANDA, {"clearance": -1}, "clearance is -1"),
        (PANDA, {"seed": -1}, "seed is -1"),
        (PANDA, {"tries": 0}, "tries is 0"),
        (PANDA, {"patience": 0}, "no layout after 0 s.*raise patience"),
    ],
)
def test_what_makes_no_sense_is_refused(robots, options, message):
    with pytest.raises(RobotLayoutsError, match=message):
        search(robots, **{"targets": CUBE, **QUICK, **options})


def test_a_package_that_is_missing_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "scipy", None)
    with pytest.raises(MissingPackageError, match=r"pip install 'robot-layouts\[checks\]'"):
        search(PANDA, CUBE)


def test_a_robot_that_touches_itself_is_refused(tmp_path):
    from tests.layouts.small_robots import FOLDING

    folded = robot(tmp_path, FOLDING, ["shoulder", "elbow"], rest=[0.0, 3.1], tcp="lower")
    with pytest.raises(LayoutError, match="touches itself .*, wherever it stands"):
        search({"arm": folded}, **QUICK)


@pytest.mark.long
def test_the_function_is_no_module():
    assert callable(layouts.search)
    assert "search" in layouts.__all__
    code = "import layouts, sys; print({'numpy', 'trimesh', 'scipy', 'fcl'} & {*sys.modules})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True)
    assert done.stdout == "set()\n"


class TestCommand:
    def run(self, words, capsys):
        status = main(["search", *words.split(), "--tries", "1", "--clearance", "0.05"])
        output = capsys.readouterr()
        return status, output.out, output.err

    def test_it_prints_the_report_and_writes_files(self, tmp_path, capsys):
        file, picture = tmp_path / "cell.yaml", tmp_path / "cell.png"
        words = f"arm=panda --target cube=0,0,0.1 --table 1.2 0.8 --out {file} --picture {picture}"
        status, out, _ = self.run(words, capsys)
        layout = search(PANDA, {"cube": (0.0, 0.0, 0.1)}, around=table(1.2, 0.8), **QUICK)
        report = layout.validate(targets={"cube": (0.0, 0.0, 0.1)})
        assert status == 0
        assert out == f"{layout}\n{report}\nlayout: {file}\npicture: {picture}\n"
        assert Layout.load(file) == layout
        assert picture.read_bytes().startswith(b"\x89PNG")

    @pytest.mark.parametrize(
        ("words", "message"),
        [
            ("arm=panda --target moon=0,0,3", "moon: arm stays"),
            ("arm=pnada", "Did you mean 'panda'"),
            ("arm", "should be name=robot"),
            ("arm=panda --target cube=0,0,0.1 --reached-by cub=arm", "Did you mean 'cube'"),
            ("arm=panda --reached-by all --reached-by any", "says twice who reaches all targets"),
        ],
    )
    def test_what_it_refuses(self, words, message, capsys):
        status, out, err = self.run(words, capsys)
        assert (status, out) == (2 if "unknown" in err else 1, "")
        assert message in err
        assert "Traceback" not in err

    @pytest.mark.long
    def test_what_is_left_out_is_told_by_the_exit_status(self, capsys):
        words = "arm=so100 --target cube=0,0,0.1 --target moon=0,0,3 --partial"
        status, out, _ = self.run(words, capsys)
        assert status == 1
        assert "no robot reaches moon" in out
        assert "cube (0, 0, 0.1): arm reaches it" in out
