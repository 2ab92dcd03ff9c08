"""Scans for tests are those of the simulator, with the truth that they state; they are read-only and kept."""

import json
import math
import subprocess
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

import echoscape
from echoscape.sim.datasets.polar_scan import Component, PolarScan
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.testing import ScanPair, ScanSettings, TargetScan, make_drive, make_pair, make_scan, scans
from echoscape.testing.scans import make_target

# ---------------------------------------------------------------------- content


@pytest.mark.parametrize("index", [0, 9])
def test_a_scan_is_that_of_the_simulator_with_the_same_settings(index: int) -> None:
    expected = echoscape.scan("yard", seed=7, index=index, scans=10, sensor=SENSORS["cts_small"])
    assert make_scan(index=index) == expected


def test_artefacts_by_name_are_those_of_the_simulator() -> None:
    given = make_scan(artefacts={"ghosts": 0, "rain": 10})
    assert given == make_scan(artefacts=Artefacts(ghosts=0, rain=10))
    assert given != make_scan()


def test_a_clean_scan_lacks_what_a_full_one_has(radar_clean: PolarScan, radar_full: PolarScan) -> None:
    def share(scan: PolarScan, component: Component) -> float:
        assert scan.truth is not None
        return float((scan.truth.cells.component == component).mean())

    assert radar_clean.truth is not None
    assert radar_full.truth is not None
    assert share(radar_clean, Component.GHOST) == 0
    assert share(radar_full, Component.GHOST) > 0.005
    assert not radar_clean.truth.saturated.any()
    assert radar_full.truth.saturated.any()
    # The same world at the same time: what stands in the way does not depend on artefacts.
    np.testing.assert_array_equal(radar_clean.truth.pose, radar_full.truth.pose)
    np.testing.assert_array_equal(radar_clean.truth.first_obstacle_m, radar_full.truth.first_obstacle_m)
    direct = [truth.cells.component == Component.DIRECT for truth in (radar_clean.truth, radar_full.truth)]
    both = direct[0] & direct[1] & (radar_clean.codes > 20)
    # Speckle of amplitude spreads the level of a cell, exponential power, by 5.6 dB rms.
    spread_db = (radar_full.codes[both].astype(float) - radar_clean.codes[both]).std() / 2
    assert 3.0 < spread_db < 7.0


def _matrix(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Homogeneous matrix of a world pose x, y, z, yaw counter-clockwise."""
    cos, sin = math.cos(pose[3]), math.sin(pose[3])
    return np.array([[cos, -sin, pose[0]], [sin, cos, pose[1]], [0, 0, 1]])


def test_the_motion_of_a_pair_is_that_of_its_true_poses(radar_pair: ScanPair) -> None:
    first, second, motion = radar_pair
    assert first.truth is not None
    assert second.truth is not None
    between = np.linalg.inv(_matrix(first.truth.middle_pose)) @ _matrix(second.truth.middle_pose)
    left_m, turn_rad = between[1, 2], math.atan2(between[1, 0], between[0, 0])
    assert_allclose([motion.x_m, motion.y_m, motion.yaw_rad], [between[0, 2], -left_m, -turn_rad], atol=1e-9)
    speed_mps = motion.x_m / (second.truth.middle_us - first.truth.middle_us) * 1e6
    assert 1.0 < speed_mps < 9.0  # a yard's limit is 8 m/s


def test_a_drive_is_ten_successive_scans_that_begin_with_the_pair(
    radar_drive: tuple[PolarScan, ...], radar_pair: ScanPair, radar_scan: PolarScan
) -> None:
    assert len(radar_drive) == 10
    assert radar_drive[:2] == (radar_pair.first, radar_pair.second)
    assert radar_drive[0] is radar_scan
    times_s = np.concatenate([scan.timestamp_us for scan in radar_drive]) / 1e6
    assert (np.diff(times_s) > 0).all()
    assert times_s[-1] - times_s[0] == pytest.approx(10 / 4, abs=0.05)
    assert make_pair(index=4) == (radar_drive[4], radar_drive[5], make_pair(index=4).motion)


# ---------------------------------------------------------------------- targets


def _peak(target: TargetScan) -> tuple[int, int]:
    row, column = np.unravel_index(int(target.scan.codes.argmax()), target.scan.codes.shape)
    return int(row), int(column)


def test_the_strongest_cell_of_the_default_target_is_at_its_range_and_bearing(
    radar_target: TargetScan,
) -> None:
    row, column = _peak(radar_target)
    assert (column + 0.5) * radar_target.scan.bin_m == pytest.approx(radar_target.range_m, abs=1e-9)
    assert radar_target.scan.azimuth_rad[row] == pytest.approx(radar_target.bearing_rad, abs=1e-9)
    assert (row, column) == (radar_target.azimuth, radar_target.bin)


@pytest.mark.parametrize(
    ("range_m", "bearing_rad"), [(10.0, 0.0), (23.4, -0.7), (50.0, 3.1), (41.0, 1.9), (65.0, 5.5)]
)
def test_the_peak_is_within_a_bin_of_the_range_and_half_a_step_of_the_bearing(
    range_m: float, bearing_rad: float
) -> None:
    target = make_target(range_m, bearing_rad)
    row, column = _peak(target)
    assert abs((column + 0.5) * target.scan.bin_m - range_m) <= 1.5 * target.scan.bin_m
    off_rad = (target.scan.azimuth_rad[row] - bearing_rad + math.pi) % (2 * math.pi) - math.pi
    assert abs(off_rad) <= 1.01 * math.pi / 100
    assert abs(target.bin - column) <= 2
    assert target.azimuth == row


def test_the_car_is_at_rest_before_the_target(radar_target: TargetScan) -> None:
    assert radar_target.scan.truth is not None
    assert np.ptp(radar_target.scan.truth.pose, axis=0).max() == 0
    assert not radar_target.scan.truth.cells.moving.any()


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
    monkeypatch.setattr(scans, "_MEMORY", {})
    monkeypatch.setattr("echoscape.sim.generation.cache.code_digest", lambda *_: "of the code")
    monkeypatch.setenv("ECHOSCAPE_CACHE", str(tmp_path / "cache"))
    return made


def only_file(tmp_path: Path) -> Path:
    (path,) = (tmp_path / "cache").iterdir()
    return path


def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scans, "_MEMORY", {})


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


def test_what_compiles_the_rays_decides_what_is_found(
    counted: Counted, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_scan()
    forget(monkeypatch)
    monkeypatch.setattr(scans, "_tracer", lambda: {"drjit": "99"})
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


# ---------------------------------------------------------------------- what cannot be made


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"preset": "moon"}, "preset must be one of town, .*, yard, got 'moon'"),
        ({"seed": -1}, "seed must be 0 or more, got -1"),
        ({"index": 10}, r"index must be from 0 to scans - 1 \(9\), got 10"),
        ({"index": -1}, "index must be from 0"),
        ({"scans": 0}, "index must be from 0"),
        ({"sensor": "moon"}, "a sensor must be one of cts350x, .* got 'moon'"),
        ({"artefacts": {"gosts": 0}}, "an artefact must be one of speckle, .* got 'gosts'"),
        ({"artefacts": {"ghosts": -1}}, "ghosts must be finite and 0 or more, got -1"),
    ],
)
def test_settings_that_cannot_be_simulated_are_refused_by_name(changes: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_scan(**changes)


def test_settings_that_do_not_exist_are_refused_by_name() -> None:
    with pytest.raises(TypeError, match="presets"):
        make_drive(presets="yard")


@pytest.mark.parametrize("range_m", [-1.0, 4.9, 88.5, math.nan, math.inf])
def test_a_target_out_of_range_is_refused(range_m: float) -> None:
    with pytest.raises(ValueError, match=r"range_m must be between 5 and 88\.4736, got"):
        make_target(range_m)


@pytest.mark.parametrize("bearing_rad", [math.nan, math.inf])
def test_a_target_in_no_direction_is_refused(bearing_rad: float) -> None:
    with pytest.raises(ValueError, match="bearing_rad must be finite, got"):
        make_target(20.0, bearing_rad)
