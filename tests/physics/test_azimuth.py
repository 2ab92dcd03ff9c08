"""A target is seen along its bearing by whoever reads the encoder, as public loaders do."""

import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from echoscape.scenes.core.target_meshes import with_targets
from echoscape.scenes.core.targets import Target
from echoscape.sim.datasets.layouts.registry import LAYOUTS
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import standing, straight, world

RANGE_M = 60.0
BEARINGS_DEG = (-0.2, 37.3, 143.0, 271.6)
"""Clockwise from ahead; the first lies between the last azimuth and the first one."""

BEAM_STEPS = 2.8
"""Half the width of the main lobe, in steps of the azimuth: the same for all radars."""


@cache
def scan_of(sensor_name: str) -> PolarScan:
    """A scan of corner reflectors 60 m away at the bearings, at the height of a radar that stands."""
    sensor = SENSORS[sensor_name]
    corners = [
        Target(
            kind="trihedral",
            position_m=(
                RANGE_M * math.cos(math.radians(bearing)),
                -RANGE_M * math.sin(math.radians(bearing)),
                sensor.mount_height_m,
            ),
            heading_rad=math.pi - math.radians(bearing),
            size_m=(0.1,),
        )
        for bearing in BEARINGS_DEG
    ]
    town = with_targets(world(), corners)
    return Simulator(
        town,
        standing(),
        seed=1,
        sensor=sensor,
        settings=TraceSettings(rays=16, max_bounces=1),
        artefacts=Artefacts(doppler=0.0),
    ).scan(0)


def read_as_loaders_do(path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Azimuths [rad] by the encoder in columns 8 and 9, 5600 counts a revolution, and the power of cells."""
    image = np.asarray(Image.open(path)).astype(np.int64)
    azimuth_rad = (image[:, 8] + 256 * image[:, 9]).astype(np.float64) * (2 * math.pi / 5600)
    return azimuth_rad, 10 ** (image[:, 11:] / 20)


def bearing_deg(azimuth_rad: NDArray, power: NDArray, bin_m: float, near_deg: float) -> float:
    """Centre of the power around a range and a bearing [deg]."""
    ranges_m = (np.arange(power.shape[1]) + 0.5) * bin_m
    ring = power[:, np.abs(ranges_m - RANGE_M) < 0.5].sum(axis=1)
    away = np.remainder(azimuth_rad - math.radians(near_deg) + math.pi, 2 * math.pi) - math.pi
    beam = np.abs(away) < math.radians(BEAM_STEPS * 360 / len(azimuth_rad))
    return near_deg + math.degrees(np.sum(ring[beam] * away[beam]) / ring[beam].sum())


def range_m(power: NDArray, row: int, bin_m: float) -> float:
    """Centre of the power of an azimuth around its strongest bin beyond 10 m [m]."""
    ranges_m = (np.arange(power.shape[1]) + 0.5) * bin_m
    peak_m = ranges_m[np.argmax(power[row] * (ranges_m > 10))]
    near = np.abs(ranges_m - peak_m) < 0.5
    return float(np.sum(power[row, near] * ranges_m[near]) / power[row, near].sum())


@pytest.mark.parametrize("sensor_name", ["cir204", "cir304", "cir304_rt"])
def test_ranges_are_true_for_a_loader_that_takes_the_bins_of_the_date(
    sensor_name: str, tmp_path: Path
) -> None:
    scan, layout = scan_of(sensor_name), LAYOUTS["boreas"]
    path = tmp_path / f"{layout.stem(scan.timestamp_us)}.png"
    layout.write_scan(path, scan)
    azimuth_rad, power = read_as_loaders_do(path)
    # pyboreas, utils/radar.py: by the time in the name, in which the radar's bins became smaller.
    bin_m = 0.04381 if int(path.stem) / 1e6 > 1632182400 else 0.0596
    row = int(np.argmin(np.abs(azimuth_rad - math.radians(BEARINGS_DEG[1]))))
    assert range_m(power, row, bin_m) == pytest.approx(RANGE_M, abs=0.05)


@pytest.mark.parametrize("layout_name", LAYOUTS)
@pytest.mark.parametrize("sensor_name", SENSORS)
def test_corner_reflectors_lie_at_their_bearings_by_the_encoder(
    sensor_name: str, layout_name: str, tmp_path: Path
) -> None:
    scan, layout = scan_of(sensor_name), LAYOUTS[layout_name]
    path = tmp_path / f"{layout.stem(scan.timestamp_us)}.png"
    layout.write_scan(path, scan)
    azimuth_rad, power = read_as_loaders_do(path)
    for bearing in BEARINGS_DEG:
        found = bearing_deg(azimuth_rad, power, scan.bin_m, bearing)
        assert found == pytest.approx(bearing, abs=0.11 * 360 / len(azimuth_rad)), bearing


SPEED_MPS = 20.0
PLACES = [(35.0, 8.0), (28.0, -12.0), (12.0, 22.0), (9.0, -27.0), (-14.0, 18.0), (-20.0, -21.0), (-31.0, 6.0)]
"""Points that stand: forward, right [m] of the car at the start."""


def sideways_m(path: Path, bin_m: float, start_us: int) -> NDArray[np.float64]:
    """How far right of the car's straight path a loader sees each of PLACES [m]."""
    image = np.asarray(Image.open(path))
    times_s = (image[:, :8].copy().view("<i8")[:, 0] - start_us) / 1e6
    azimuth_rad, power = read_as_loaders_do(path)
    ranges_m = (np.arange(power.shape[1]) + 0.5) * bin_m
    found = []
    for forward, right in PLACES:
        ahead = forward - SPEED_MPS * times_s
        aside = np.arctan2(right, ahead) - azimuth_rad
        rows = np.abs(np.remainder(aside + math.pi, 2 * math.pi) - math.pi) < math.radians(2.5)
        near = power * (np.abs(ranges_m - np.hypot(right, ahead)[:, None]) < 0.7) * rows[:, None]
        place = ranges_m * np.sin(azimuth_rad)[:, None]
        found.append((near * place).sum() / near.sum())
    return np.array(found)


def test_a_car_that_drives_straight_has_no_sideways_motion_by_the_encoder(tmp_path: Path) -> None:
    sensor = SENSORS["cts350x"]
    points = [Target(kind="point", position_m=(x, -y, sensor.mount_height_m)) for x, y in PLACES]
    drive = straight([0.0, 0.0], [SPEED_MPS, 0.0])
    simulator = Simulator(
        with_targets(world(), points),
        drive,
        seed=2,
        sensor=sensor,
        settings=TraceSettings(rays=16, max_bounces=1),
        artefacts=Artefacts(doppler=0.0),
    )
    seen = []
    for index in (0, 1):
        path = tmp_path / f"{index}.png"
        LAYOUTS["oxford"].write_scan(path, simulator.scan(index))
        seen.append(sideways_m(path, sensor.bin_m, sensor.epoch_us))
    # Azimuths that were 0.84 deg off would turn the 5 m of the motion, by 0.073 m to the side.
    assert (seen[0] - seen[1]).mean() == pytest.approx(0.0, abs=0.015)
    np.testing.assert_allclose(seen[0], [right for _, right in PLACES], atol=0.1)
