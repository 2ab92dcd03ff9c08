"""The pytest plugin: options, fixtures with scans of known content, and golden scans.

pytest loads it in every environment that has echoscape installed, so it imports nothing but pytest until a
fixture is used. `pytest --fixtures` lists the fixtures with their docstrings.
"""

import os
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from echoscape.testing.settings import CLEAN, ScanSettings

if TYPE_CHECKING:
    from echoscape.sim.datasets.polar_scan import PolarScan
    from echoscape.testing.golden import GoldenScans
    from echoscape.testing.scans import ScanPair
    from echoscape.testing.target import TargetScan

_CACHE_VARIABLE = "ECHOSCAPE_CACHE"
_WRITTEN = "radar_golden"
"""Name of the property of a test that has the digest and the path of a golden scan that it has written."""
_CACHE_BEFORE: pytest.StashKey[str | None] = pytest.StashKey()
_WRITERS: pytest.StashKey[dict[Path, str]] = pytest.StashKey()


# ---------------------------------------------------------------------- options


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options, each also as an ini option."""
    group = parser.getgroup("radar", "simulated radar scans (echoscape)")
    defaults = ScanSettings()
    for name, metavar, text in (
        ("preset", "NAME", f"kind of world of the radar fixtures (default: {defaults.preset})"),
        ("seed", "N", f"seed of the radar fixtures (default: {defaults.seed})"),
        ("sensor", "NAME", f"radar of the radar fixtures, or a TOML file (default: {defaults.sensor})"),
        ("cache", "DIR", f"folder that keeps simulated scans; off: none (default: ${_CACHE_VARIABLE})"),
    ):
        group.addoption(f"--radar-{name}", metavar=metavar, default=None, help=text)
        parser.addini(f"radar_{name}", f"as --radar-{name}", default="")
    group.addoption(
        "--radar-update-golden",
        action="store_true",
        help="write the scans that radar_golden.check is given as the stored ones",
    )


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    """Select the folder of the cache, for worker processes as well; refuse options that name nothing."""
    config.stash[_WRITERS] = {}
    config.stash[_CACHE_BEFORE] = os.environ.get(_CACHE_VARIABLE)
    for name in ("cache", "sensor"):
        _check_path(config, f"--radar-{name}")
    given, written = config.getoption("radar_cache"), config.getini("radar_cache")
    if given or written:
        base = config.invocation_params.dir if given else config.rootpath
        place = os.path.expanduser(given or written)  # a shell leaves the "~" after "=" alone
        os.environ[_CACHE_VARIABLE] = place if place.lower() in ("0", "off") else str(base / place)
        config.option.radar_cache = os.environ[_CACHE_VARIABLE]
    _check_seed(_option(config, "seed"))
    _check_preset(_option(config, "preset"))
    _check_sensor(_option(config, "sensor"))


def _check_seed(seed: str | None) -> None:
    if seed is not None and not seed.isdecimal():
        raise pytest.UsageError(f"--radar-seed must be a whole number of 0 or more, got {seed!r}")


def _check_preset(preset: str | None) -> None:
    if preset is None:
        return
    from echoscape.scenes.town.presets import PRESETS

    if preset not in PRESETS:
        raise pytest.UsageError(f"--radar-preset must be one of {', '.join(PRESETS)}, got {preset!r}")


def _check_sensor(sensor: str | None) -> None:
    if sensor is None:
        return
    from echoscape.sim.sensor.registry import sensor_from

    try:
        sensor_from(sensor)
    except ValueError as error:
        raise pytest.UsageError(f"--radar-sensor: {error}") from error


def _check_path(config: pytest.Config, option: str) -> None:
    """Refuse a path outside of the folder of the run unless it is written after "=".

    pytest looks for its ini file before it knows the options of plugins: it would take the path, if there is
    one, for a folder of tests, and the folder that holds it and the tests for the root of the project.
    """
    words, folder = config.invocation_params.args, config.invocation_params.dir
    paths = [Path(os.path.normpath(folder / after)) for word, after in pairwise(words) if word == option]
    if any(not path.is_relative_to(folder) for path in paths):
        raise pytest.UsageError(f"{option} must be followed by '=' where its path is outside of {folder}")


def pytest_unconfigure(config: pytest.Config) -> None:
    """Put the folder of the cache back."""
    if _CACHE_BEFORE not in config.stash:
        return
    before = config.stash[_CACHE_BEFORE]
    if before is None:
        os.environ.pop(_CACHE_VARIABLE, None)
    else:
        os.environ[_CACHE_VARIABLE] = before


def _option(config: pytest.Config, name: str) -> str | None:
    """Return an option of the command line, else of the ini file, None where neither has it."""
    return config.getoption(f"radar_{name}") or config.getini(f"radar_{name}") or None


@pytest.fixture(scope="session")
def radar_settings(pytestconfig: pytest.Config) -> ScanSettings:
    """What the radar fixtures simulate, with the options of the command line."""
    changes: dict[str, Any] = {}
    for name in ("preset", "seed", "sensor"):
        value = _option(pytestconfig, name)
        if value is not None:
            changes[name] = int(value) if name == "seed" else value
    return ScanSettings(**changes)


# ---------------------------------------------------------------------- fixtures
# None but the settings is used by another: a project may have one of the same name with a narrower scope.


@pytest.fixture(scope="session")
def make_radar_scan(radar_settings: ScanSettings) -> "Callable[..., PolarScan]":
    """Make any scan: `make_radar_scan(preset=..., seed=..., index=..., artefacts={"rain": 10}, sensor=...)`.

    What is not given is as in `radar_scan`. Scans are read-only: change a copy.
    """
    from echoscape.testing.scans import make_scan

    def make(**changes: Any) -> "PolarScan":
        return make_scan(radar_settings, **changes)

    return make


@pytest.fixture(scope="session")
def make_radar_target(radar_settings: ScanSettings) -> "Callable[..., TargetScan]":
    """Make a scan of a corner reflector: `make_radar_target(range_m=20, bearing_rad=-0.3, artefacts=...)`."""
    from echoscape.testing.target import make_target

    def make(range_m: float | None = None, bearing_rad: float | None = None, **changes: Any) -> "TargetScan":
        return make_target(range_m, bearing_rad, settings=radar_settings, **changes)

    return make


@pytest.fixture(scope="session")
def radar_scan(radar_settings: ScanSettings) -> "PolarScan":
    """A scan with its truth, read-only: codes in half decibels, 100 azimuths x 512 bins by default."""
    from echoscape.testing.scans import make_scan

    return make_scan(radar_settings)


@pytest.fixture(scope="session")
def radar_pair(radar_settings: ScanSettings) -> "ScanPair":
    """Two successive scans of a moving car and the true motion between them: (first, second, motion)."""
    from echoscape.testing.scans import make_pair

    return make_pair(radar_settings)


@pytest.fixture(scope="session")
def radar_drive(radar_settings: ScanSettings) -> "tuple[PolarScan, ...]":
    """Ten successive scans of a drive; the first two are those of `radar_pair`."""
    from echoscape.testing.scans import make_drive

    return make_drive(radar_settings)


@pytest.fixture(scope="session")
def radar_target(radar_settings: ScanSettings) -> "TargetScan":
    """A corner reflector on a plane, the car at rest: (scan, range_m, bearing_rad)."""
    from echoscape.testing.target import make_target

    return make_target(settings=radar_settings)


@pytest.fixture(scope="session")
def radar_clean(radar_settings: ScanSettings) -> "PolarScan":
    """The scan `radar_full` without ghosts, speckle and saturation."""
    from echoscape.testing.scans import make_scan

    return make_scan(radar_settings, artefacts=CLEAN)


@pytest.fixture(scope="session")
def radar_full(radar_settings: ScanSettings) -> "PolarScan":
    """The scan `radar_clean` with ghosts, speckle and saturation, which is `radar_scan`."""
    from echoscape.testing.scans import make_scan

    return make_scan(radar_settings)


# ---------------------------------------------------------------------- golden scans


@pytest.fixture
def radar_golden(request: pytest.FixtureRequest) -> "Iterator[GoldenScans]":
    """Compare scans with stored ones: `radar_golden.check(scan, "name")`; `--radar-update-golden` stores."""
    from echoscape.testing.golden import GoldenScans

    here = request.config.invocation_params.dir
    _, *inner = request.node.nodeid.split("::")
    golden = GoldenScans(
        request.path.parent / "golden" / request.path.stem,
        test="::".join([os.path.relpath(request.path, here), *inner]),
        update=bool(request.config.getoption("radar_update_golden")),
        writers=request.config.stash[_WRITERS],
    )
    yield golden
    for path, digest in golden.written.items():
        entry = f"{digest} {os.path.relpath(path, here)}"
        request.node.user_properties.append((_WRITTEN, entry))


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail where two tests have stored different scans under one name, which processes cannot know."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    written = {} if reporter is None else _written(reporter)
    if any(len(digests) > 1 for digests in written.values()) and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def _written(reporter: Any) -> dict[str, dict[str, str]]:
    """Return the tests that have stored a scan, of all processes: by its path and its digest."""
    found: dict[str, dict[str, str]] = {}
    for report in (each for group in reporter.stats.values() for each in group):
        for name, entry in getattr(report, "user_properties", ()):
            if name == _WRITTEN:
                digest, path = entry.split(" ", 1)
                found.setdefault(path, {})[digest] = report.nodeid
    return found


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """List the golden scans that were written, by all processes."""
    if not config.getoption("radar_update_golden"):
        return
    found = _written(terminalreporter)
    terminalreporter.section("golden scans")
    for path, tests in sorted(found.items()):
        if len(tests) > 1:
            names = " and ".join(sorted(tests.values()))
            terminalreporter.write_line(
                f"ERROR: {path} was stored by {names}, with different scans: each needs a name of its own",
                red=True,
            )
        else:
            terminalreporter.write_line(f"written: {path}")
    if not found:
        terminalreporter.write_line("all as stored; nothing written")
