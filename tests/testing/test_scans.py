"""Scans for tests are those of the simulator, with the truth that they state; they are read-only and kept."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from numpy.typing import NDArray

import echoscape
from echoscape.sim.datasets.polar_scan import Component, PolarScan
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.testing import ScanPair, make_drive, make_pair, make_scan, make_target

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


# ---------------------------------------------------------------------- what cannot be made


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"preset": "moon"}, "preset must be one of town, .*, yard, got 'moon'"),
        ({"seed": -1}, "seed must be 0 or more, got -1"),
        ({"index": 10}, r"index must be from 0 to scans - 1 \(9\), got 10"),
        ({"index": -1}, "index must be from 0"),
        ({"scans": 0}, "scans must be 1 or more, got 0"),
        ({"seed": 1.5}, "seed must be a whole number, got 1.5"),
        ({"index": "1"}, "index must be a whole number, got '1'"),
        ({"scans": True}, "scans must be a whole number, got True"),
        ({"sensor": "moon"}, "a sensor must be one of cts350x, .* got 'moon'"),
        ({"artefacts": {"gosts": 0}}, "an artefact must be one of speckle, .* got 'gosts'"),
        ({"artefacts": {"ghosts": -1}}, "ghosts must be finite and 0 or more, got -1"),
    ],
)
def test_settings_that_cannot_be_simulated_are_refused_by_name(changes: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_scan(**changes)


@pytest.mark.parametrize("make", [make_scan, make_pair, make_drive, make_target])
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"artefacts": 5}, "artefacts must be of type Artefacts or Mapping or None, got 5"),
        ({"artefacts": ["ghosts"]}, "artefacts must be of type Artefacts or Mapping or None, got"),
        ({"artefacts": {"ghosts"}}, "artefacts must be of type Artefacts or Mapping or None, got"),
        ({"sensor": 5}, "sensor must be of type Sensor or str, got 5"),
        ({"sensor": Path("mine.toml")}, "sensor must be of type Sensor or str, got .*Path"),
    ],
)
def test_settings_of_another_type_are_refused_by_name(
    make: Callable[..., object], changes: dict, message: str
) -> None:
    with pytest.raises(TypeError, match=f"^{message}"):
        make(**changes)


def test_settings_that_do_not_exist_are_refused_by_name() -> None:
    with pytest.raises(TypeError, match="presets"):
        make_drive(presets="yard")
