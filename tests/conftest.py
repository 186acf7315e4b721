"""One thread per test process, and the rule for tests that need what not every machine has.

A test marked ``native`` needs the ``parity`` extra and a Vulkan driver, one marked ``browser``
needs playwright and Debian's chromium. Where either is missing it is skipped and the summary says
why; with ``ROBOT_LAYOUTS_REQUIRE_NATIVE=1`` (as in CI) a skip is a failure, and so is a run in
which no native test passed.
"""

import functools
import gc
import importlib.util
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import hypothesis
import pytest

os.environ.setdefault("OMP_NUM_THREADS", "1")  # read when torch is imported
os.environ.setdefault("MUJOCO_GL", "egl")  # read when mujoco is imported

# A shell's background jobs ignore these, and so would every process that a test sends one.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
signal.signal(signal.SIGQUIT, signal.SIG_DFL)

# However slow or busy the machine is, no example of a property takes too long.
hypothesis.settings.register_profile(
    "any machine", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("any machine")

REQUIRED = os.environ.get("ROBOT_LAYOUTS_REQUIRE_NATIVE") == "1"


@functools.cache
def native_problem() -> str | None:
    """Say why native ManiSkill cannot run here, or None if it can."""
    if importlib.util.find_spec("mani_skill") is None:
        return "mani_skill is not installed; pip install -e '.[parity]'"
    probe = [sys.executable, "-c", "import sapien; sapien.render.RenderSystem()"]
    done = subprocess.run(probe, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        last_line = (done.stderr.strip().splitlines() or ["no message"])[-1]
        return f"native ManiSkill needs a Vulkan driver: {last_line}"
    return None


@functools.cache
def browser_problem() -> str | None:
    """Say why no browser can be driven here, or None if one can."""
    if importlib.util.find_spec("playwright") is None:
        return "playwright is not installed; pip install 'robot-layouts[browser]'"
    if shutil.which("chromium") is None:
        return "there is no chromium; apt-get install chromium"
    return None


PROBLEMS = {"native": lambda: native_problem(), "browser": lambda: browser_problem()}


def optional_problem() -> str | None:
    """Say why robots of an optional package cannot be found, or None if they can."""
    from tests.catalogue import optional_problem as problem

    return problem()


def pytest_xdist_auto_num_workers() -> int:
    """One process more than there are cores, because tests also wait: for deadlines, say."""
    return len(os.sched_getaffinity(0)) + 1


def pytest_runtest_setup(item: pytest.Item) -> None:
    for marker, find_problem in {**PROBLEMS, "example_robots": optional_problem}.items():
        if item.get_closest_marker(marker) and (problem := find_problem()):
            pytest.skip(problem)


@pytest.fixture(scope="session", autouse=True)
def one_device() -> Iterator[None]:
    """Let everything draw on native's device: a process can draw on no more than one."""
    if importlib.util.find_spec("mani_skill") is None:
        yield
        return
    import sapien.render
    from sapien import Device

    made = sapien.render.RenderSystem
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            sapien.render, "RenderSystem", lambda device=None: made(device or Device("cpu"))
        )
        yield


@pytest.fixture(scope="session")
def renderer() -> object:
    """Keep alive what all pictures of a process share, or None where nothing can be drawn.

    It goes with the last scene that can be drawn, and the next one would compute how light is
    reflected anew: 6 s of processor time.
    """
    from robot_layouts.simulation.rendering import vulkan_problem

    if vulkan_problem():
        return None
    from sapien import Device
    from sapien.render import RenderSystem

    from robot_layouts.simulation.sapien3.device import outlive_forks

    system = RenderSystem(Device("cpu"))  # native's; a process can draw on no more than one
    outlive_forks(system)
    return system


@pytest.fixture
def drawn(renderer: object) -> None:
    """Skip where nothing can be drawn."""
    from robot_layouts.simulation.rendering import vulkan_problem

    if problem := vulkan_problem():
        pytest.skip(problem)


@pytest.hookimpl(tryfirst=True)  # before xdist looks at the groups
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Give what shares something costly to one process, which makes it once.

    That are all comparisons of a task, for its native environment, and all that is drawn.
    """
    for item in items:
        if name := _group(item):
            item.add_marker(pytest.mark.xdist_group(name))
    if getattr(config.option, "loadgroup", False):
        _put_groups_into_ids(items)


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect no garbage while tests are collected, and later only that of what tests make.

    To go through all tests and modules takes half a second, and native does it with every world.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()
        gc.freeze()


def _put_groups_into_ids(items: list[pytest.Item]) -> None:
    """Do what xdist 3.8 does in vain since pytest 9.2 keeps an item's id in another attribute."""
    for item in items:
        group = item.get_closest_marker("xdist_group")
        if group is not None and hasattr(item, "_id"):
            item._id = type(item._id).parse(f"{item.nodeid}@{group.args[0]}")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Send the tests of a file to one process too, where each would go to any of them."""
    if config.getoption("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadGroupScheduling

    class Scheduling(LoadGroupScheduling):
        def _split_scope(self, nodeid: str) -> str:
            group = super()._split_scope(nodeid)
            return nodeid.partition("::")[0] if group == nodeid else group

    return Scheduling(config, log)


def _group(item: pytest.Item) -> str | None:
    if "renderer" in getattr(item, "fixturenames", ()):
        return "pictures"
    parameters = getattr(item, "callspec", None)
    if parameters is None or not item.get_closest_marker("native"):
        return None
    return parameters.params.get("task_id")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Iterator[None]:
    report = yield
    if REQUIRED and report.skipped and any(map(item.get_closest_marker, PROBLEMS)):
        _turn_skip_into_failure(report)
    return report


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[None]:
    report = yield
    if REQUIRED and report.skipped and "mani_skill" in str(report.longrepr):
        _turn_skip_into_failure(report)
    return report


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    passed, skipped = (
        sum(_is_native(report) for report in terminalreporter.stats.get(outcome, []))
        for outcome in ("passed", "skipped")
    )
    if passed or skipped or REQUIRED:
        terminalreporter.write_line(f"native comparison: {passed} passed, {skipped} skipped")
    if REQUIRED and not passed:
        terminalreporter.write_line("native comparison: required, but no test of it passed")


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    if not REQUIRED or hasattr(session.config, "workerinput"):
        return
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    passed = reporter.stats.get("passed", []) if reporter else []
    if not any(_is_native(report) for report in passed):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def _is_native(report: pytest.TestReport | pytest.CollectReport) -> bool:
    return isinstance(report, pytest.TestReport) and "native" in report.keywords


def _turn_skip_into_failure(report: pytest.TestReport | pytest.CollectReport) -> None:
    reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
    report.outcome = "failed"
    what = "browser test" if "browser" in report.keywords else "native comparison"
    report.longrepr = f"the {what} is required here, but: {reason}"
