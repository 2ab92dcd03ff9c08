"""The plugin as other projects use it: options, fixtures, golden scans, several processes, its own weight."""

import hashlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from echoscape.scenes.town import presets
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.sensor import registry
from echoscape.testing import ScanSettings, golden_figure
from tests.paths import ROOT

pytest_plugins = ["pytester"]
LOADED = golden_figure, presets, registry
"""Loaded before pytester runs anything in this process: it forgets what a run loads, and NumPy loads once."""

PAGE, REFERENCE = ((ROOT / "docs" / path).read_text() for path in ("testing.md", "reference/testing.md"))
HOME = os.environ.get("HOME", "/")
SETTINGS = "def test_settings(radar_settings): assert repr(radar_settings) == {expected!r}"


@pytest.fixture(autouse=True)
def own_options(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs within this one have options of their own, but the compiled kernels in the user's home."""
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    monkeypatch.setenv("HOME", HOME)


def run(pytester: pytest.Pytester, *words: str) -> pytest.RunResult:
    """Run pytest in this process, without the plugin whose summary takes a second."""
    return pytester.runpytest_inprocess(*words, "-p", "no:hypothesispytest")


def run_apart(pytester: pytest.Pytester, *words: str) -> pytest.RunResult:
    """Run pytest in a process of its own, as scans are simulated there."""
    return pytester.runpytest_subprocess(*words, "-p", "no:hypothesispytest", timeout=120)


def expect_settings(pytester: pytest.Pytester, *words: str, **changes: object) -> None:
    expected = repr(ScanSettings(**changes))  # pyright: ignore[reportArgumentType]
    pytester.makepyfile(SETTINGS.format(expected=expected))
    run(pytester, *words).assert_outcomes(passed=1)


# ---------------------------------------------------------------------- options


def test_options_decide_what_the_fixtures_simulate(pytester: pytest.Pytester) -> None:
    expect_settings(pytester)
    words = ["--radar-preset", "empty", "--radar-seed=3", "--radar-sensor", "cir204"]
    expect_settings(pytester, *words, preset="empty", seed=3, sensor="cir204")


def test_options_of_the_ini_file_hold_unless_the_command_line_has_them(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\nradar_preset = empty\nradar_seed = 5\n")
    expect_settings(pytester, preset="empty", seed=5)
    expect_settings(pytester, "--radar-seed", "6", preset="empty", seed=6)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--radar-preset", "moon"], "--radar-preset must be one of town, .*, yard, got 'moon'"),
        (["--radar-sensor", "moon"], "--radar-sensor: a sensor must be one of cts350x, .* got 'moon'"),
        (["--radar-seed", "x"], "--radar-seed must be a whole number of 0 or more, got 'x'"),
        (["--radar-seed=-3"], "--radar-seed must be a whole number of 0 or more, got '-3'"),
    ],
)
def test_options_that_name_nothing_stop_the_run_with_one_line(
    pytester: pytest.Pytester, words: list[str], message: str
) -> None:
    pytester.makepyfile("def test_scan(radar_scan): pass")
    done = run(pytester, *words)
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    assert done.stdout.str().strip() == ""
    (line,) = done.stderr.str().strip().splitlines()
    assert re.fullmatch(f"ERROR: {message}", line)


def test_names_in_the_ini_file_are_checked_at_the_start_too(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\nradar_preset = moon\n")
    assert run(pytester).ret == pytest.ExitCode.USAGE_ERROR
    expect_settings(pytester, "--radar-preset", "empty", preset="empty")


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--radar-cache", "kept"], "{folder}/kept"),
        (["--radar-cache=off"], "off"),
        (["--radar-cache=~/kept"], f"{HOME}/kept"),
        ([], "before"),
    ],
)
def test_the_cache_lies_where_the_option_says_during_the_run(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch, words: list[str], expected: str
) -> None:
    monkeypatch.setenv("ECHOSCAPE_CACHE", "before")
    expected = expected.format(folder=pytester.path)
    pytester.makepyfile(f"import os\ndef test_cache(): assert os.environ['ECHOSCAPE_CACHE'] == {expected!r}")
    run(pytester, *words).assert_outcomes(passed=1)
    assert os.environ["ECHOSCAPE_CACHE"] == "before"


def test_the_cache_of_the_ini_file_is_relative_to_it(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("ECHOSCAPE_CACHE")
    pytester.makeini("[pytest]\nradar_cache = kept\n")
    folder = pytester.mkdir("inner")
    expected = str(pytester.path / "kept")
    (folder / "test_it.py").write_text(
        f"import os\ndef test_cache(): assert os.environ['ECHOSCAPE_CACHE'] == {expected!r}"
    )
    monkeypatch.chdir(folder)
    run(pytester).assert_outcomes(passed=1)
    assert "ECHOSCAPE_CACHE" not in os.environ


def test_paths_elsewhere_come_after_an_equals_sign_so_that_pytest_finds_its_ini_file(
    pytester: pytest.Pytester, tmp_path: Path
) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    pytester.makeini("[pytest]\npythonpath = src\n")
    pytester.mkdir("src").joinpath("module_of_the_project.py").touch()
    pytester.makepyfile("import module_of_the_project\ndef test(): pass")
    run(pytester, f"--radar-cache={elsewhere}").assert_outcomes(passed=1)
    for option in ("--radar-cache", "--radar-sensor"):
        done = run(pytester, option, str(elsewhere))
        assert done.ret == pytest.ExitCode.USAGE_ERROR
        done.stderr.fnmatch_lines([f"*{option} must be followed by '=' where its path is outside of*"])
    pytester.mkdir("inside")
    run(pytester, "--radar-cache", "inside").assert_outcomes(passed=1)


def test_options_and_fixtures_are_documented(pytester: pytest.Pytester) -> None:
    helped = run(pytester, "--help").stdout.str()
    listed = run(pytester, "--fixtures").stdout.str()
    for option in ("preset", "seed", "sensor", "cache", "update-golden"):
        assert f"--radar-{option}" in helped
        assert f"--radar-{option}" in PAGE
        assert f"--radar-{option}" in REFERENCE
    public = ("scan", "pair", "drive", "target", "clean", "full", "golden")
    for name in (*(f"radar_{each}" for each in public), "make_radar_scan", "make_radar_target"):
        assert re.search(rf"^{name}\b.*\n    \S", listed, re.MULTILINE)
        assert f"`{name}" in REFERENCE


# ---------------------------------------------------------------------- fixtures, as the page shows them


@pytest.mark.usefixtures("radar_target", "radar_pair", "radar_clean", "radar_full")  # kept on disk by these
def test_the_examples_of_the_pages_pass_once_their_scan_is_stored(pytester: pytest.Pytester) -> None:
    short, long = (re.findall(r"```python\n(.*?)```", page, re.DOTALL) for page in (PAGE, REFERENCE))
    pytester.makepyfile(test_radar=short[0], test_more=long[0])
    first = run_apart(pytester)
    first.assert_outcomes(passed=4, failed=1)
    first.stdout.fnmatch_lines(["*there is no stored scan golden/test_radar/*.png"])
    run_apart(pytester, "--radar-update-golden").assert_outcomes(passed=5)
    run_apart(pytester).assert_outcomes(passed=5)


def test_the_page_takes_a_minute_to_read() -> None:
    prose, examples = re.sub(r"```.*?```", "", PAGE, flags=re.DOTALL), PAGE.count("```python")
    assert len([line for line in prose.splitlines() if line]) <= 10
    assert examples == 1
    assert len(PAGE.splitlines()) <= 25


@pytest.mark.usefixtures("radar_target", "radar_pair", "radar_clean", "radar_full")  # kept on disk by these
def test_a_project_may_have_fixtures_of_its_own_under_these_names(pytester: pytest.Pytester) -> None:
    names = ("radar_scan", "radar_target", "radar_pair", "radar_drive", "radar_clean", "radar_full")
    names = (*names, "make_radar_scan", "make_radar_target")
    pytester.makeconftest(
        "import os, pytest\n"
        "def own(): return 'own'\n"
        f"kept = os.environ['KEPT']\nfor name in {names}:\n"
        "    if name != kept: globals()[name] = pytest.fixture(name=name)(own)\n"
    )
    pytester.makepyfile(
        """
        import os, pytest
        def test_kept(request): assert request.getfixturevalue(os.environ["KEPT"]) != "own"
        """
    )
    for name in names:
        with pytest.MonkeyPatch().context() as patch:
            patch.setenv("KEPT", name)
            run(pytester).assert_outcomes(passed=1)


@pytest.mark.usefixtures("radar_pair")
def test_factories_start_from_the_options(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        def test_factories(make_radar_scan, make_radar_target, radar_settings):
            scan = make_radar_scan(index=1)
            assert scan.truth.middle_us > make_radar_scan().truth.middle_us
            assert scan == make_radar_scan(seed=7, index=1)
            assert make_radar_target(20, bearing_rad=-0.3).range_m == 20
        """
    )
    run_apart(pytester, "--radar-seed=7").assert_outcomes(passed=1)


# ---------------------------------------------------------------------- several processes


def test_processes_that_begin_with_an_empty_cache_get_the_same_bytes(
    pytester: pytest.Pytester, radar_scan: PolarScan
) -> None:
    pytester.makepyfile(
        """
        import hashlib, os
        from pathlib import Path

        def test_scan(radar_scan):
            assert "kept" in os.environ["ECHOSCAPE_CACHE"]
            digest = hashlib.sha256(radar_scan.codes.tobytes()).hexdigest()
            Path(f"{os.environ['PYTEST_XDIST_WORKER']}.digest").write_text(digest)
        """
    )
    words = ["--dist", "each", "--tx", "2*popen", "--radar-cache", "kept"]
    run_apart(pytester, *words).assert_outcomes(passed=2)
    digests = [path.read_text() for path in pytester.path.glob("*.digest")]
    assert digests == 2 * [hashlib.sha256(radar_scan.codes.tobytes()).hexdigest()]
    assert len(list(pytester.path.glob("kept/scan-*"))) == 1


def test_golden_scans_of_several_processes_are_all_reported(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import numpy as np
        import pytest

        @pytest.mark.parametrize("number", range(4))
        def test_codes(radar_golden, number):
            radar_golden.check(np.full((3, 4), number, np.uint8), f"codes_{number}")
        """
    )
    done = run_apart(pytester, "-n", "2", "--radar-update-golden")
    done.assert_outcomes(passed=4)
    (name,) = (path.name for path in (pytester.path / "golden").iterdir())
    done.stdout.fnmatch_lines([f"written: golden/{name}/codes_{number}.png" for number in range(4)])
    again = run(pytester, "--radar-update-golden")
    again.stdout.fnmatch_lines(["all as stored; nothing written"])


@pytest.mark.parametrize(("second", "fails"), [(1, True), (0, False)])
def test_processes_that_store_different_scans_under_one_name_are_told(
    pytester: pytest.Pytester, second: int, fails: bool
) -> None:
    pytester.makepyfile(
        test_it=f"""
        import time
        from pathlib import Path

        import numpy as np
        import pytest

        @pytest.mark.parametrize("value", [0, {second}], ids=["a", "b"])
        def test_codes(radar_golden, value, request):
            Path(request.node.name).touch()  # neither stores before the other has begun
            while len(list(Path().glob("test_codes*"))) < 2:
                time.sleep(0.01)
            radar_golden.check(np.full((3, 4), value, np.uint8), "codes")
        """
    )
    done = run_apart(pytester, "-n", "2", "--radar-update-golden")
    done.assert_outcomes(passed=2)
    assert (done.ret == pytest.ExitCode.TESTS_FAILED) == fails
    assert ("ERROR: golden/test_it/codes.png was stored by" in done.stdout.str()) == fails
    if fails:
        done.stdout.fnmatch_lines(["*by test_it.py::test_codes?a? and test_it.py::test_codes?b?, with diff*"])


def test_a_golden_scan_lies_beside_its_test_and_fails_without_a_long_traceback(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = pytester.mkdir("inner")
    code = (
        "import numpy as np\ndef test_it(radar_golden): radar_golden.check(np.{made}((3, 4), np.uint8), 'x')"
    )
    (folder / "test_it.py").write_text(code.format(made="zeros"))
    run(pytester, "--radar-update-golden").assert_outcomes(passed=1)
    assert (folder / "golden" / "test_it" / "x.png").is_file()
    (folder / "test_it.py").write_text(code.format(made="ones"))
    pytester.makeini("[pytest]")  # tests are named relative to this file, commands to the folder of the run
    monkeypatch.chdir(folder)
    done = run(pytester)
    done.assert_outcomes(failed=1)
    said = done.stdout.str()
    assert "12 of 12 cells differ (1), by up to 1 codes (0.5 dB)" in said
    assert "_problem" not in said
    (command,) = re.findall(r'pytest "(.*?)" (--radar-update-golden)', said.split("short test summary")[0])
    run(pytester, *command).assert_outcomes(passed=1)  # the command of the message
    run(pytester).assert_outcomes(passed=1)


# ---------------------------------------------------------------------- weight


def test_the_plugin_loads_nothing_until_a_fixture_is_used() -> None:
    code = (
        "import json, sys, pytest; before = set(sys.modules); import echoscape.testing.plugin\n"
        "print(json.dumps(sorted({name.split('.')[0] for name in set(sys.modules) - before})))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert set(json.loads(done.stdout)) <= {"echoscape", "lazy_loader", "ast", "inspect", "dis", "opcode"}


def test_importing_the_fixtures_module_of_public_names_loads_no_ray_tracer() -> None:
    code = (
        "import sys; from echoscape.testing import *; print('scipy' in sys.modules or 'drjit' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert done.stdout == "False\n"


def test_no_test_of_another_project_is_changed(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\nfilterwarnings = error\naddopts = --strict-markers --strict-config\n")
    pytester.makepyfile("def test_it(): assert 1 + 1 == 2")
    done = run_apart(pytester)
    done.assert_outcomes(passed=1)
    assert "radar" not in done.stdout.str()
    assert Path(pytester.path / "golden").exists() is False
