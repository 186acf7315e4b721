"""LeRobot in an environment of its own: its commands train, evaluate and report on our tasks."""

import os
import shutil
import subprocess
import sys
from hashlib import sha256
from pathlib import Path

import pytest

from tests.clients.environments import ROOT, installed, play

HERE = Path(__file__).parent
REQUIREMENTS = HERE / "requirements" / "lerobot.txt"
CONSTRAINTS = ROOT / "constraints" / "lerobot.txt"
OURS = (f"{ROOT}[export,video]", str(ROOT / "integrations" / "lerobot_env_robot_layouts"))
PROGRAMS = ("", "_cameras", "_eval", "_eval_cameras", "_hub")
VERSIONS = ("python3.12", "python3.13")  # LeRobot needs 3.12; torch of constraints ends at 3.14
BYTES = 12e9  # the environment takes 6 GB, and pip as much for what it unpacks

pytestmark = [pytest.mark.long, pytest.mark.xdist_group("lerobot")]


@pytest.fixture(scope="session")
def lerobot(tmp_path_factory, pytestconfig):
    """A Python that has LeRobot: LEROBOT_PYTHON, or one that is made once and kept in the cache."""
    if given := os.environ.get("LEROBOT_PYTHON"):
        return Path(given)
    base = next(filter(None, map(working, VERSIONS)), None)
    if base is None:
        pytest.skip(f"LeRobot needs one of {', '.join(VERSIONS)}")
    wanted = REQUIREMENTS.read_bytes() + CONSTRAINTS.read_bytes()
    name = f"lerobot-{sha256(wanted).hexdigest()[:12]}"
    cache = getattr(pytestconfig, "cache", None)
    folder = (cache.mkdir("environments") if cache else tmp_path_factory.mktemp("own")) / name
    if not (folder / "complete").exists():
        shutil.rmtree(folder, ignore_errors=True)
        if shutil.disk_usage(folder.parent).free < BYTES:
            pytest.skip(f"LeRobot's environment takes {BYTES / 1e9:.0f} GB while it is made")
        subprocess.run([base, "-m", "venv", folder], check=True)
        words = ["-c", str(CONSTRAINTS), "-r", str(REQUIREMENTS), "-e", OURS[0], "-e", OURS[1]]
        installed(folder / "bin" / "python", words, REQUIREMENTS.name)
        (folder / "complete").touch()
    return folder / "bin" / "python"


def working(name):
    """Return where a Python is, None if there is none: a name alone may be that of a shim."""
    own = f"python3.{sys.version_info.minor}"
    found = sys.executable if name == own else shutil.which(name)
    known = [found] if found else []
    root = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    known += sorted(map(str, root.glob(f"versions/{name.removeprefix('python')}.*/bin/python")))
    return next((python for python in known if runs(python)), None)


def runs(python):
    done = subprocess.run(
        [python, "-c", "import venv, ensurepip"], capture_output=True, check=False
    )
    return done.returncode == 0


@pytest.mark.parametrize("part", PROGRAMS)
def test_lerobot(part, lerobot, tmp_path, request):
    if part in ("_cameras", "_eval_cameras", "_hub"):
        request.getfixturevalue("renderer")
    play(lerobot, HERE / "programs" / f"lerobot{part}_program.py", tmp_path / "out")


def test_every_program_is_run():
    assert {path.stem for path in (HERE / "programs").glob("lerobot*_program.py")} == {
        f"lerobot{part}_program" for part in PROGRAMS
    }
