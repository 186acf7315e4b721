"""The names of `import robot_layouts as rl`."""

import subprocess
import sys
from importlib.util import find_spec

import pytest

import robot_layouts as rl
from robot_layouts import _HOMES


def test_no_module_has_the_name_of_what_the_face_shows():
    """Once imported, it would be in the place of the function."""
    homes = {name: home for home, names in _HOMES.items() for name in names}
    assert set(homes) == set(rl.__all__)
    taken = [f"{home}.{name}" for name, home in homes.items() if _is_module(f"{home}.{name}")]
    assert taken == []


def _is_module(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:  # its home is a module, which holds none
        return False


@pytest.mark.long
def test_view_is_a_function_when_what_views_was_imported_first():
    code = "import robot_layouts.data.viewing, robot_layouts as rl; print(callable(rl.view))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "True"
