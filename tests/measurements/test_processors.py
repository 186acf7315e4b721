"""``python -m measurements.processors``: what depends on the processor, and what does not."""

from __future__ import annotations

import json
import shutil
from importlib.metadata import version
from pathlib import Path
from platform import libc_ver

import pytest

from measurements.processors.__main__ import PACKAGES, main
from measurements.processors.measure import EMULATOR, differences, physics, play_under, summary
from measurements.processors.play import EXPERT, Played
from measurements.processors.settings import PLAIN, PORTABLE, Setting, settings
from measurements.processors.table import markdown
from robots import SimulationError

RECORD = Path(__file__).parents[2] / "docs/processors.json"
FEW = [
    Played("PickCube-v1", 0, "pd_joint_delta_pos", 6),
    Played("StackCube-v1", 0, EXPERT, 0),
    Played("PokeCube-v1", 4, "pd_ee_delta_pose", 4),
]


def recorded():
    return json.loads(RECORD.read_text())


def test_the_page_is_the_records():
    assert RECORD.with_suffix(".md").read_text() == "\n".join(markdown(recorded())) + "\n"


def test_nothing_portable_differs():
    compared = [seen for seen in recorded()["settings"].values() if seen["against"] == PORTABLE]
    assert len(compared) >= 1
    assert not any(seen["different"] for seen in compared)
    assert all(seen["episodes"] >= 10 for seen in compared)


@pytest.mark.long
def test_what_depends_on_the_processor_is_seen():
    one = play_under(settings()[PLAIN], FEW)
    other = play_under(settings()["MKL, any"], FEW)
    found = differences(FEW, one, other)
    assert "states" in found[str(FEW[2])]  # by torch's square roots
    assert summary(found)["states"] == len([kinds for kinds in found.values() if "states" in kinds])


@pytest.mark.long
def test_portable_physics_is_the_recorded_one():
    was = recorded()
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


def test_differences_are_named_by_the_first_moment():
    played = Played("PickCube-v1", 0, EXPERT, 0)
    one = {"actions": ["a", "b"], "states": ["s", "t"], "observations": [], "rewards": ["r"]}
    other = {"actions": ["a", "c"], "states": ["s", "t"], "observations": [], "rewards": []}
    assert differences([played], [one], [other]) == {str(played): {"actions": 1, "rewards": -1}}
    assert differences([played], [one], [one]) == {}
    assert differences([played], [None], [one]) == {}


@pytest.mark.long
def test_a_process_that_ends_too_early_is_reported():
    with pytest.raises(SimulationError, match="after 0 of 1 episodes"):
        play_under(Setting("", {}), [Played("PickCubr-v1", 0, EXPERT, 0)])


def test_an_emulator_that_is_missing():
    setting = settings()["Nehalem, portable"]
    with pytest.raises(SimulationError, match=r"no program 'qemu-none' to emulate a Nehalem"):
        play_under(setting, FEW, emulator="qemu-none")


def test_what_is_no_record_is_left_alone(tmp_path, capsys):
    out = tmp_path / "seen.json"
    out.write_text("[]")
    assert main(["--out", str(out), "--table"]) == 1
    assert "holds no record of processors" in capsys.readouterr().err
    assert out.read_text() == "[]"
