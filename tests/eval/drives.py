"""Small folders of scans of a drive that is known by hand: few cells, no town, no rays."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from echoscape.eval.odometry.interface import PairFailed, PairMotion
from echoscape.sim.datasets.files.navtech_png import write_png
from echoscape.sim.datasets.layouts.oxford import OdometryRow, write_odometry
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.datasets.scan_folder import ScanFolder, open_folder
from echoscape.sim.sensor.cts350x import CTS350X

TINY = replace(CTS350X, azimuths=8, bins=16)
START_US = 1_700_000_000_000_000
TURN_US = 250_000
LAST_AZIMUTH_US = 7 * 31_250
BIN_M = 2 * CTS350X.bin_m

Motion = tuple[float, float, float]
"""x forward, y right [m], yaw clockwise [rad]."""


def square(side_m: int = 60, *, step_m: float = 2.0, laps: int = 1) -> list[Motion]:
    """A drive clockwise around a square: straight sides, and corners taken in one motion."""
    side = [(step_m, 0.0, 0.0)] * round(side_m / step_m - 1) + [(step_m, 0.0, math.pi / 2)]
    return side * (4 * laps)


def write_drive(folder: Path, motions: Sequence[Motion], *, truth: bool = True) -> Path:
    """Write empty scans of a drive in Oxford's layout, with the motion between them if `truth`."""
    (folder / "radar").mkdir(parents=True)
    for number in range(len(motions) + 1):
        scan = _scan(np.zeros((8, 16), np.uint8), number, TINY.bin_m)
        write_png(folder / "radar" / f"{START_US + number * TURN_US}.png", scan)
    if truth:
        write_truth(folder, motions)
    return folder


def write_truth(folder: Path, motions: Sequence[Motion]) -> None:
    """Write the motion between the scans."""
    (folder / "gt").mkdir()
    motion_rows = [_row(number, motion) for number, motion in enumerate(motions)]
    write_odometry(folder / "gt" / "radar_odometry.csv", motion_rows)


def opened(folder: Path) -> ScanFolder:
    """The folder of `write_drive`."""
    return open_folder(folder, layout="oxford", sensor=TINY)


class Knowing:
    """A method that knows the drive, but fails at some pairs; `seen` has the scans that it was given."""

    def __init__(self, motions: Sequence[Motion], *, failing: Sequence[int] = (), blind: int = -1) -> None:
        self.motions, self.failing, self.blind = motions, failing, blind
        self.seen: list[int] = []

    @property
    def name(self) -> str:
        return "knowing"

    def start(self, scan: PolarScan) -> int:
        number = (int(scan.timestamp_us[0]) - START_US) // TURN_US
        self.seen.append(number)
        if number == self.blind:
            raise PairFailed("nothing to see")
        return number

    def follow(self, state: int, scan: PolarScan) -> tuple[PairMotion, int]:
        number = self.start(scan)
        assert number == state + 1
        if state in self.failing:
            raise PairFailed("asked to fail")
        x, y, yaw = self.motions[state]
        return PairMotion(x_m=x, y_m=y, yaw_rad=yaw), number


def landmarks(*, seed: int = 4, count: int = 150) -> np.ndarray:
    """Places (count, 2), forward, right [m], within 60 m of the start and not too near."""
    rng = np.random.default_rng(seed)
    return np.stack([rng.uniform(-60, 60, count), rng.uniform(-60, 60, count)], axis=1)


def scan_of(points_m: np.ndarray, motion: Motion, *, number: int = 0) -> PolarScan:
    """A scan of points (K, 2) in the frame of the start, seen after `motion`, each a small spot."""
    x, y, yaw = motion
    away = points_m - [x, y]
    # The car's axes are those of the start, turned clockwise by yaw: forward (cos, sin), right (-sin, cos).
    forward = away @ [math.cos(yaw), math.sin(yaw)]
    right = away @ [-math.sin(yaw), math.cos(yaw)]
    azimuths = np.arctan2(right, forward) / (2 * math.pi) * 400 - 13 / 14  # the first looks along 13 / 5600
    bins = np.hypot(forward, right) / BIN_M - 0.5
    i, k = np.arange(400)[:, None, None], np.arange(1000)[None, :, None]
    codes = np.zeros((400, 1000))
    for azimuth, at in zip(azimuths, bins, strict=True):
        off = (i[..., 0] - azimuth + 200) % 400 - 200
        codes = np.maximum(codes, 100 - 8 * off**2 - 2 * (k[..., 0] - at) ** 2)
    return _scan(np.rint(codes).astype(np.uint8), number, BIN_M)


def write_points(folder: Path, motion: Motion) -> Path:
    """Write two scans of landmarks as the CTS350-X writes them, before and after `motion`, with its truth."""
    (folder / "radar").mkdir(parents=True)
    for number, seen in enumerate([(0.0, 0.0, 0.0), motion]):
        scan = scan_of(landmarks(), seen, number=number)
        fine = np.repeat(scan.codes, 2, axis=1)
        wide = replace(scan, codes=np.pad(fine, ((0, 0), (0, CTS350X.bins - 2000))))
        write_png(folder / "radar" / f"{START_US + number * TURN_US}.png", wide)
    write_truth(folder, [motion])
    return folder


def _scan(codes: np.ndarray, number: int, bin_m: float) -> PolarScan:
    azimuths = len(codes)
    step_us = LAST_AZIMUTH_US // (azimuths - 1)
    return PolarScan(
        codes=codes,
        timestamp_us=START_US + number * TURN_US + step_us * np.arange(azimuths, dtype=np.int64),
        encoder=(13 + 5600 // azimuths * np.arange(azimuths)).astype(np.uint16),
        valid=np.ones(azimuths, bool),
        bin_m=bin_m,
    )


def _row(number: int, motion: Motion) -> OdometryRow:
    stamp = START_US + number * TURN_US
    return OdometryRow(
        source_us=stamp + TURN_US + LAST_AZIMUTH_US // 2,
        destination_us=stamp + LAST_AZIMUTH_US // 2,
        x=motion[0],
        y=motion[1],
        z=0.0,
        roll=0.0,
        pitch=0.0,
        yaw=motion[2],
        source_radar_us=stamp + TURN_US,
        destination_radar_us=stamp,
    )
