"""What importing the rooms and loading a robot must not do, by audit hooks in new processes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

CHECKOUT = Path(__file__).parents[2]
HEAVY = (
    "sapien",
    "torch",
    "mani_skill",
    "huggingface_hub",
    "yourdfpy",
    "lxml",
    "trimesh",
    "rich",
    "numpy",
    "matplotlib",
    "yaml",
    "fcl",
    "scipy",
    "viser",
)

AUDIT = """
import sys
seen = []
def watch(event, arguments):
    if event.startswith("socket."):
        seen.append((event, ""))
    elif event == "open" or event.startswith("os."):
        seen.append((event, str(arguments[0]) if arguments else ""))
sys.addaudithook(watch)
"""


def run(code: str, **variables: str) -> list[str]:
    command = [sys.executable, "-c", AUDIT + code]
    done = subprocess.run(
        command,
        cwd=CHECKOUT,
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_importing_robots_and_layouts_loads_nothing_heavy_and_opens_no_socket():
    code = f"""
import robots, layouts, layouts.__main__, robot_layouts
from robot_layouts import kinematics
print(*[name for name in {HEAVY!r} if name in sys.modules])
print(*[event for event, path in seen if event.startswith("socket.")])
print("ran")
"""
    assert run(code) == ["ran"]


def test_loading_a_robot_touches_no_robot_file():
    code = """
from robots import RobotRegistry
for name in RobotRegistry.names():
    RobotRegistry.load(name).describe_action()
files = ("assets_cache", "manifest.json", ".urdf", ".srdf", ".stl", ".glb", "robot-layouts")
print(*[path for event, path in seen if any(part in path for part in files)])
print(*[event for event, path in seen if event.startswith("socket.")])
print("opened", any("robots" in path for event, path in seen))
"""
    assert run(code) == ["opened", "True"]


def test_locating_loads_neither_the_hub_client_nor_the_simulator(tmp_path: Path):
    code = f"""
import robots.assets.fetching
from robots.assets.manifest import MANI_SKILL
from robots.assets.sources import InstalledPackage
robots.assets.fetching.default_sources = lambda: [InstalledPackage(MANI_SKILL)]
robots.RobotRegistry.load("panda").urdf.locate()
print(*[name for name in {HEAVY!r} if name in sys.modules])
print("ran")
"""
    assert run(code, ROBOT_LAYOUTS_ASSETS=str(tmp_path)) == ["ran"]
