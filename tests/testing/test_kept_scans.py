"""Scans for tests are simulated once, kept on disk, made again where anything differs, and read-only."""

import json
import subprocess
import sys
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.testing import ScanSettings, TargetScan, kept_scans, make_drive, make_scan, scans
from echoscape.testing.kept_scans import kept

# ---------------------------------------------------------------------- read-only


def _arrays(record: object) -> list[NDArray]:
    found = []
    for each in fields(record):  # pyright: ignore[reportArgumentType]
        value = getattr(record, each.name)
        found += [value] if isinstance(value, np.ndarray) else _arrays(value) if is_dataclass(value) else []
    return found


def test_no_array_of_a_scan_or_of_its_truth_can_be_written_to(
    radar_scan: PolarScan, radar_target: TargetScan
) -> None:
    arrays = _arrays(radar_scan) + _arrays(radar_target.scan)
    assert len(arrays) > 30
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


# ---------------------------------------------------------------------- in memory


@dataclass(frozen=True, kw_only=True)
class Half:
    """Bytes, some of them in a record of their own."""

    codes: NDArray[np.uint8]
    inner: "Half | None" = None


def _half(size: int) -> Half:
    inner = Half(codes=np.zeros(size - size // 2, np.uint8))
    return Half(codes=np.zeros(size // 2, np.uint8), inner=inner)


@pytest.fixture
def built(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the records that are built; 100 bytes fit into memory, nothing is kept on disk."""
    monkeypatch.setattr(kept_scans, "_MEMORY", {})
    monkeypatch.setattr(kept_scans, "MOST_BYTES", 100)
    monkeypatch.setenv("ECHOSCAPE_CACHE", "off")
    return []


@given(asked=st.text("abcdeZ", max_size=40))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_memory_holds_what_was_asked_for_last_up_to_its_limit(built: list[str], asked: str) -> None:
    kept_scans._MEMORY.clear()
    sizes = {name: 120 if name == "Z" else 30 for name in "abcdeZ"}
    recent: list[str] = []  # the last first
    for name in asked:
        built.clear()

        def build(name: str = name) -> Half:
            built.append(name)
            return _half(sizes[name])

        kept("half", Half, {"name": name}, build)
        assert built == ([] if name in recent else [name])
        recent = [name, *(each for each in recent if each != name)]
        while len(recent) > 1 and sum(sizes[each] for each in recent) > 100:
            recent.pop()
        assert len(kept_scans._MEMORY) == len(recent)


# ---------------------------------------------------------------------- on disk


class Counted:
    """Stands for the simulation, and counts."""

    def __init__(self, scan: PolarScan) -> None:
        self.scan = scan
        self.settings: list[ScanSettings] = []

    def __call__(self, settings: ScanSettings) -> PolarScan:
        self.settings.append(settings)
        return self.scan


@pytest.fixture
def counted(radar_scan: PolarScan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Counted:
    """Simulations are counted; nothing is in memory or on disk."""
    made = Counted(radar_scan)
    monkeypatch.setattr(scans, "_simulated", made)
    monkeypatch.setattr(kept_scans, "_MEMORY", {})
    monkeypatch.setattr("echoscape.sim.generation.cache.code_digest", lambda *_: "of the code")
    monkeypatch.setenv("ECHOSCAPE_CACHE", str(tmp_path / "cache"))
    return made


def only_file(tmp_path: Path) -> Path:
    (path,) = (tmp_path / "cache").iterdir()
    return path


def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_scans, "_MEMORY", {})


def test_a_scan_is_simulated_once_and_comes_back_equal_and_read_only(
    counted: Counted, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = make_scan()
    assert make_scan() is first
    forget(monkeypatch)
    again = make_scan()
    assert again == first
    assert again is not first
    assert not any(array.flags.writeable for array in _arrays(again))
    assert len(counted.settings) == 1


@pytest.mark.parametrize(
    "change",
    [
        {"preset": "empty"},
        {"seed": 8},
        {"index": 1},
        {"scans": 11},
        {"sensor": "cir204"},
        {"sensor": SENSORS["cts_small"]},
        {"artefacts": {"ghosts": 0}},
        {"artefacts": Artefacts(ghosts=0.5)},
    ],
    ids=str,
)
def test_each_setting_decides_what_is_found(counted: Counted, change: dict) -> None:
    make_scan()
    make_scan(**change)
    assert len(counted.settings) == 2


@pytest.mark.parametrize(
    ("change", "same"),
    [
        (
            {"seed": np.int64(3), "index": np.int8(2), "scans": np.uint16(5)},
            {"seed": 3, "index": 2, "scans": 5},
        ),
        ({"artefacts": {"ghosts": np.float32(0.5)}}, {"artefacts": {"ghosts": 0.5}}),
        ({"artefacts": {"ghosts": np.bool_(False)}}, {"artefacts": {"ghosts": False}}),
    ],
    ids=["whole", "strength", "bool"],
)
def test_numbers_of_numpy_are_the_same_settings(counted: Counted, change: dict, same: dict) -> None:
    make_scan(**change)
    make_scan(**same)
    assert len(counted.settings) == 1


def test_a_file_of_a_sensor_counts_by_what_it_says(counted: Counted, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    for noise_figure in (10, 10, 20):
        path.write_text(f'base = "cts_small"\nnoise_figure_db = {noise_figure}')
        make_scan(sensor=str(path))
    assert len(counted.settings) == 2
    with pytest.raises(ValueError, match=r"nowhere\.toml: cannot be read"):
        make_scan(sensor=str(tmp_path / "nowhere.toml"))


def test_what_compiles_the_rays_decides_what_is_found(
    counted: Counted, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_scan()
    forget(monkeypatch)
    monkeypatch.setattr(kept_scans, "_tracer", lambda: {"drjit": "99"})
    make_scan()
    assert len(counted.settings) == 2


@pytest.mark.parametrize("changed", ["scenes", "sim", "testing", "eval"])
def test_code_that_makes_a_scan_decides_what_is_found(
    counted: Counted, monkeypatch: pytest.MonkeyPatch, changed: str
) -> None:
    make_scan()
    forget(monkeypatch)
    monkeypatch.setattr(
        "echoscape.sim.generation.cache.code_digest",
        lambda packages: "changed" if changed in packages else "of the code",
    )
    make_scan()
    assert len(counted.settings) == 1 + (changed != "eval")


@pytest.mark.parametrize("damage", ["cut", "flipped", "foreign", "empty", "folder"])
def test_a_file_that_is_broken_or_foreign_is_made_again(
    counted: Counted, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damage: str
) -> None:
    expected = make_scan()
    path = only_file(tmp_path)
    data = bytearray(path.read_bytes())
    path.unlink()
    if damage == "folder":
        path.mkdir()
    else:
        data[len(data) // 2] ^= 1
        broken = {"cut": data[:-100], "flipped": data, "foreign": b"\x80\x04N.", "empty": b""}[damage]
        path.write_bytes(broken)
    forget(monkeypatch)
    assert make_scan() == expected
    assert len(counted.settings) == 2


@pytest.mark.usefixtures("counted")
def test_kept_scans_load_without_ray_tracer_town_or_scipy() -> None:
    expected = [int(scan.codes.sum()) for scan in make_drive(scans=2)]
    names = ("mitsuba", "drjit", "scipy", "shapely", "matplotlib", "torch")
    code = (
        f"import sys, json; sys.modules.update(dict.fromkeys({names}))\n"
        "from echoscape.sim.generation import cache\n"
        "cache.code_digest = lambda *_: 'of the code'\n"
        "from echoscape.testing import make_drive\n"
        "print(json.dumps([int(scan.codes.sum()) for scan in make_drive(scans=2)]))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == expected
