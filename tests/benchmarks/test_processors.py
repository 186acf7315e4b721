"""``python -m benchmarks processors``: what depends on the processor, and what does not."""

from __future__ import annotations

import json
import shutil
from importlib.metadata import version
from pathlib import Path
from platform import libc_ver

import pytest

from benchmarks.asking import EMULATOR, PLAIN, answers_under
from benchmarks.processors import (
    EXPERT,
    PACKAGES,
    PORTABLE,
    Played,
    _driver,
    differences,
    drawings,
    physics,
    play_under,
    settings,
)
from benchmarks.receipts import CELLS, STEPS, ways

RECORD = Path(__file__).parents[2] / "docs/processors.json"
FEW = [
    Played("PickCube-v1", 0, "pd_joint_delta_pos", 6),
    Played("StackCube-v1", 0, EXPERT, 0),
    Played("PokeCube-v1", 4, "pd_ee_delta_pose", 4),
]


@pytest.mark.long
def test_portable_physics_is_the_recorded_one():
    was = json.loads(RECORD.read_text())
    now = {**{name: version(name) for name in PACKAGES}, "glibc": libc_ver()[1]}
    if was["versions"] != now:
        pytest.skip(f"recorded with {was['versions']}, and these are {now}")
    episodes = [Played("StackCube-v1", 0, EXPERT, 0), Played("PokeCube-v1", 5, "pd_ee_pose", 8)]
    found = physics(episodes, play_under(settings()[PORTABLE], episodes))
    assert found == {name: was["portable"][name] for name in found}


@pytest.mark.long
def test_an_emulated_processor_computes_the_same():
    if shutil.which(EMULATOR) is None:
        pytest.skip(f"there is no {EMULATOR}")
    native = play_under(settings()[PORTABLE], FEW)
    assert not differences(FEW, native, play_under(settings()["Nehalem, portable"], FEW))
    assert differences(FEW, native, play_under(settings()["Nehalem, as it is"], FEW))


@pytest.mark.long
def test_a_receipt_of_pictures_is_verified_with_other_threads_but_not_without_avx(
    renderer, tmp_path
):
    if "llvmpipe" not in _driver():
        pytest.skip("these variables are of Mesa's software driver alone")
    request = {"task": "PickCube-v1", "file": str(tmp_path / "a.json"), "workers": 0, "count": 1}
    found = {
        name: answers_under(ways()[name].setting, "benchmarks.receipts", request, 1)[0]
        for name in ("as it is", "two threads", "SSE")
    }
    pictures = (STEPS + 1) * 2  # by two cameras
    same = {"episodes": 1, "pictures": pictures, "equal": 1, "other_pictures": 0}
    assert found["two threads"] == same
    assert found["as it is"] == found["two threads"]
    assert found["SSE"]["equal"] == 0


def test_the_page_says_where_receipts_are_equal():
    record = json.loads(RECORD.read_text())["receipts"]
    known = ways()
    assert {name for name, way in known.items() if not way.setting.emulated} <= {*record["ways"]}
    for name, way in record["ways"].items():
        assert list(way["cells"]) == list(CELLS)
        for cell, seen in way["cells"].items():
            whole = seen["equal"] == seen["episodes"] and not seen["other_pictures"]
            assert whole == (name != "SSE"), (name, cell)


def test_the_page_says_which_pictures_differ():
    ways = json.loads(RECORD.read_text())["pictures"]["ways"]
    assert list(ways) == list(drawings())
    same = [name for name, way in ways.items() if way["images"] and not way["different"]]
    assert same == [PLAIN, "once more", "no threads", "one thread", "two threads", *WIDE, "AVX"]
    assert not ways["128 bits"]["images"]


WIDE = ("256 bits", "512 bits")
