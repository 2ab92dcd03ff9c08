"""A small folder in Oxford's layout: scans of random point targets from a moving car, with exact truth."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.files.navtech_png import write_png
from echoscape.sim.datasets.layouts.oxford import OdometryRow, write_odometry
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.sensor.cts350x import CTS350X

AZIMUTHS, BINS, BIN_M = CTS350X.azimuths, CTS350X.bins, CTS350X.bin_m


def world(seed: int, count: int = 250, reach_m: float = 90.0) -> NDArray[np.float64]:
    """Return point targets (count, 2) forward, right [m] around the origin."""
    return np.random.default_rng(seed).uniform(-reach_m, reach_m, (count, 2))


def codes_from(spots: NDArray[np.float64], pose: tuple[float, float, float]) -> NDArray[np.uint8]:
    """Return the codes (azimuths, bins) of points seen from a pose x, y [m], yaw [rad] in Oxford axes."""
    x, y, yaw = pose
    away = spots - (x, y)
    azimuth = (np.arctan2(away[:, 1], away[:, 0]) - yaw) % (2 * math.pi)
    distance = np.hypot(*away.T)
    codes = np.zeros((AZIMUTHS, BINS))
    rows, columns = np.arange(-6, 7), np.arange(-60, 61)
    rows_at = azimuth / (2 * math.pi) * AZIMUTHS - 13 / 14  # the first azimuth looks along 13 / 5600
    for angle, range_m in zip(rows_at, distance / BIN_M - 0.5, strict=True):
        row, column = round(angle), round(range_m)
        wide = np.exp(-(((row + rows - angle) / 2) ** 2))[:, None] * np.exp(
            -(((column + columns - range_m) / 25) ** 2)
        )
        inside = (column + columns >= 0) & (column + columns < BINS)
        place = np.ix_((row + rows) % AZIMUTHS, (column + columns)[inside])
        codes[place] = np.maximum(codes[place], 110 * wide[:, inside])
    return np.rint(codes).astype(np.uint8)


def motion_between(
    earlier: tuple[float, float, float], later: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Return x, y [m], yaw [rad] of the later pose seen from the earlier one, Oxford axes."""
    east, north, yaw = later[0] - earlier[0], later[1] - earlier[1], earlier[2]
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return cosine * east + sine * north, cosine * north - sine * east, later[2] - earlier[2]


def write_folder(folder: Path, poses: list[tuple[float, float, float]], *, seed: int = 1) -> Path:
    """Write scans of random points from poses x, y [m], yaw [rad] in Oxford axes, and their odometry."""
    (folder / "radar").mkdir(parents=True)
    (folder / "gt").mkdir()
    spots, stamps = world(seed), [CTS350X.epoch_us + 250_000 * i for i in range(len(poses))]
    for stamp, pose in zip(stamps, poses, strict=True):
        scan = PolarScan(
            codes=codes_from(spots, pose),
            timestamp_us=stamp + 625 * np.arange(AZIMUTHS),
            encoder=(13 + 14 * np.arange(AZIMUTHS)).astype(np.uint16),
            valid=np.ones(AZIMUTHS, bool),
            bin_m=BIN_M,
        )
        write_png(folder / "radar" / f"{stamp}.png", scan)
    rows = [
        _row(*times, motion_between(*pair))
        for times, pair in zip(pairwise(stamps), pairwise(poses), strict=True)
    ]
    write_odometry(folder / "gt" / "radar_odometry.csv", rows)
    return folder


def _row(earlier_us: int, later_us: int, motion: tuple[float, float, float]) -> OdometryRow:
    return OdometryRow(
        source_us=later_us + 125_000,
        destination_us=earlier_us + 125_000,
        x=motion[0],
        y=motion[1],
        z=0.0,
        roll=0.0,
        pitch=0.0,
        yaw=motion[2],
        source_radar_us=later_us,
        destination_radar_us=earlier_us,
    )
