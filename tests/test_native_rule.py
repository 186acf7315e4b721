"""The rules of ``conftest.py``: which tests skip, or fail if required, and which go together."""

from pathlib import Path

import pytest

from tests.quick import quick_cases

pytest_plugins = ["pytester"]

SKIPS = ["pytest.skip('later')", "pytest.importorskip('no_such_package')"]
NATIVE_TEST = "import pytest\n@pytest.mark.native\ndef test_native(): {}\n"


RULE = (Path(__file__).parent / "conftest.py").read_text()
NATIVE_RUNS = "\ndef native_problem(): return None\n"  # wherever these tests themselves run


@pytest.fixture
def run(pytester, monkeypatch):
    """Run a one-test file under a copy of the rule; return the result of that pytest."""
    pytester.makeini("[pytest]\nmarkers = native")

    def run(source, *, required, vulkan=True):
        pytester.makeconftest(RULE + NATIVE_RUNS if vulkan else RULE)
        monkeypatch.setenv("ROBOT_LAYOUTS_REQUIRE_NATIVE", "1" if required else "0")
        for variable in ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"):
            monkeypatch.setenv(variable, "nowhere.json")
        pytester.makepyfile(source)
        return pytester.runpytest_subprocess("-p", "no:cacheprovider", "-rs")

    return run


@pytest.mark.long
def test_without_vulkan_it_fails_if_required(run):
    result = run(NATIVE_TEST.format("pass"), required=True, vulkan=False)
    assert result.ret == pytest.ExitCode.TESTS_FAILED
    result.stdout.fnmatch_lines(["*native comparison is required here, but: *"])


@pytest.mark.long
@pytest.mark.parametrize("required", [False, True])
def test_without_a_browser_it_is_skipped_or_fails_if_required(run, monkeypatch, tmp_path, required):
    monkeypatch.setenv("PATH", str(tmp_path))
    browser = "import pytest\n@pytest.mark.browser\ndef test_page(): pass\n"
    result = run(browser + "@pytest.mark.native\ndef test_native(): pass\n", required=required)
    result.assert_outcomes(passed=1, skipped=not required, errors=required)
    result.stdout.re_match_lines([r".*(there is no chromium|playwright is not installed)"])


@pytest.mark.parametrize("how", quick_cases(SKIPS, SKIPS[:1]))
def test_a_skip_inside_the_test_fails_if_required(run, how):
    pass_first = "import pytest\n@pytest.mark.native\ndef test_other(): pass\n"
    result = run(pass_first + NATIVE_TEST.format(how), required=True)
    assert result.ret == pytest.ExitCode.TESTS_FAILED


@pytest.mark.xdist_group("together")
def test_xdist_learns_of_groups(request):
    """Else each of their tests goes to any process, and each process makes what they share."""
    if not hasattr(request.config, "workerinput"):
        pytest.skip("there is one process")
    assert request.node.nodeid.endswith("@together")
