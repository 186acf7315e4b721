"""What the library does in processes that lack something: called in a fresh one, which it changes.

Importing this loads nothing, so that what is hidden was not there from the start.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import sys
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType

ROOMS = ("robots", "objects", "layouts", "tasks", "robot_layouts")
# What needs usd-core at import, and what needs MuJoCo Warp.
NEED_MORE = (
    "layouts.export.usd",
    *(
        f"robot_layouts.simulation.mujoco_warp.{name}"
        for name in ("kernels", "simulation", "worlds")
    ),
)

# What macOS lacks of Linux, and Windows of both: modules, and names of modules.
LACKING = {
    "darwin": (
        (),
        {
            "os": ("memfd_create", "posix_fallocate", "sched_getaffinity", "sched_setaffinity"),
            "time": ("pthread_getcpuclockid",),
        },
    ),
    "win32": (
        ("fcntl", "grp", "pwd", "resource", "termios"),
        {
            "os": (
                *("O_CLOEXEC", "O_DIRECTORY", "O_NONBLOCK", "fork", "killpg", "memfd_create"),
                *("posix_fallocate", "pread", "register_at_fork", "sched_getaffinity"),
                *("sched_setaffinity", "sysconf"),
            ),
            "mmap": ("MAP_ANONYMOUS", "MAP_PRIVATE", "PROT_EXEC", "PROT_READ", "PROT_WRITE"),
            "select": ("poll",),
            "signal": ("SIGKILL", "pthread_sigmask"),
            "socket": ("AF_UNIX", "MSG_DONTWAIT", "recv_fds", "send_fds"),
            "time": ("clock_gettime", "pthread_getcpuclockid"),
        },
    ),
}


class _Finder:
    """Finds no module of some packages."""

    def __init__(self, names: Iterable[str]) -> None:
        self._names = set(names)

    def find_spec(self, name: str, *_: object) -> None:
        if name.partition(".")[0] in self._names:
            raise ImportError(f"{name} is hidden")


def hide(*packages: str) -> None:
    """Let packages that nothing has imported yet be missing."""
    assert not {*packages} & {*sys.modules}, "they are imported already"
    sys.meta_path.insert(0, _Finder(packages))  # pyright: ignore[reportArgumentType]


def become(system: str) -> None:
    """Let this process lack what another operating system lacks.

    Packages of others ask for the system as they are imported: the library is imported before, and
    then forgotten.
    """
    import_all()
    importlib.import_module("sapien.wrapper.pinocchio_model")
    for name in [name for name in sys.modules if name.partition(".")[0] in ROOMS]:
        del sys.modules[name]
    modules, names = LACKING[system]
    for module in modules:
        sys.modules.pop(module, None)
    sys.meta_path.insert(0, _Finder(modules))  # pyright: ignore[reportArgumentType]
    for module, missing in names.items():
        for name in missing:
            if hasattr(importlib.import_module(module), name):
                delattr(importlib.import_module(module), name)
    sys.platform = system


def import_all(but: str = "") -> int:
    """Import every module of the library but those of a package; return how many."""
    count = 0
    for room in ROOMS:
        for name in _modules(importlib.import_module(room)):
            main = name.endswith(("__main__", "processes.server"))
            if not main and name not in NEED_MORE and not (but and name.startswith(but)):
                importlib.import_module(name)
                count += 1
    return count


def _modules(package: ModuleType) -> list[str]:
    found = pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    return [package.__name__, *(module.name for module in found)]


def without(package: str, backend: str, folder: str) -> dict[str, object]:
    """Import all that does not simulate with a package, and use what needs no physics."""
    hide(package)
    modules = import_all(but=backend)
    import tasks
    from layouts import face_to_face
    from robot_layouts.motion import plan

    layout = face_to_face({"left": "panda", "right": "panda_stick"}, spacing=1.5)
    goal = layout["left"].start_qpos
    return {
        "modules": modules,
        "tasks": len([tasks.get_task_class(name).scenario for name in tasks.list_tasks()]),
        "right": layout.validate().ok,
        "urdf": layout.to_urdf(os.path.join(folder, "cell.urdf")).stat().st_size > 0,
        "duration": plan(layout, goals={"left": (0.3, *goal[1:])}).duration,
        "loaded": package in sys.modules,
    }


def play(hidden: tuple[str, ...], simulator: str) -> float:
    """Play some steps where packages are missing; return what they gave."""
    hide(*hidden)
    import tasks

    env = tasks.make("TwoRobotPickCube-v1", simulator=simulator)
    env.reset(seed=0)
    env.action_space.seed(0)
    return sum(float(env.step(env.action_space.sample())[1][0]) for _ in range(5))


def demo(folder: str) -> list[str]:
    """Let an expert that tries grasps in physics play where SAPIEN is missing; return the files."""
    hide("sapien")
    from rich.console import Console

    from robot_layouts.data.demo import DemoOptions, run_demo
    from tasks.cell_options import CellOptions

    cell, out = CellOptions(simulator="mujoco"), Path(folder)
    run_demo(DemoOptions(task="TwoRobotHandOver-v1", seeds=1, out=out, cell=cell), Console())
    return sorted(file.name for file in out.iterdir())


def refusal(simulator: str, package: str) -> str:
    """Make a task where its simulator is missing; return what is said."""
    hide(package)
    import tasks
    from robots import MissingPackageError

    try:
        tasks.make("PickCube-v1", simulator=simulator)
    except MissingPackageError as error:
        return str(error)
    return ""


def import_seam() -> list[str]:
    """Import what is above the seam of simulators; return which of them came along."""
    hide("sapien", "mujoco")
    for name in (*ROOMS, "layouts.export.mjcf", "robot_layouts.simulation", "tasks.vocabulary"):
        importlib.import_module(name)
    return [name for name in ("sapien", "mujoco", "torch") if name in sys.modules]


def on(system: str, folder: str) -> dict[str, object]:
    """Do on another operating system what a user does first; return what came of it."""
    become(system)
    import_all()
    import gymnasium

    import robot_layouts as rl
    from robot_layouts.core.errors import RobotLayoutsError

    env = rl.make("PickCube-v1")
    env.reset(seed=0)
    path = os.path.join(folder, "recorded")
    rl.record("PickCube-v1", [0], path)
    vector = gymnasium.make_vec("RobotLayouts/PickCube-v1", num_envs=2)
    vector.reset(seed=0)
    try:
        rl.evaluate("expert", "PickCube-v1", [0], workers=2)
        refusal = ""
    except RobotLayoutsError as error:
        refusal = str(error)
    return {
        "reward": float(env.step(env.action_space.sample() * 0)[1][0]),
        "score": rl.evaluate("expert", "PickCube-v1", [0]).success_rate,
        "recorded": sorted(os.listdir(path)),
        "rewards": vector.step(vector.action_space.sample() * 0)[1].tolist(),
        "refusal": refusal,
    }
