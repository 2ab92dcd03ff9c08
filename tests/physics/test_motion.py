"""The rolling scan: how far a car drives in it, how walls bend, and that compensation straightens them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.sim.datasets.motion_compensation import to_mid_scan
from echoscape.sim.datasets.polar_scan import PolarScan
from echoscape.sim.echoes import Echoes
from echoscape.sim.receiver.quantiser import decibels
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.physics.laws import LawRecorder
from tests.physics.tracing import HEIGHT_M, STEADY
from tests.sim.worlds import plate, straight, world

SECTION = "Motion"
SPEED = 15.0
AHEAD = plate([45.0, 0, HEIGHT_M], [-1, 0], 100.0, 8.0)
SLANTED = plate([-22.0, 22.0, HEIGHT_M], [1, -1], 80.0, 8.0)
"""A wall at 45 deg behind the car, to its left; 31.1 m from the origin."""


@pytest.fixture(scope="module")
def simulator() -> Simulator:
    return Simulator(
        world(("soil", "wall", AHEAD), ("soil", "wall", SLANTED)),
        straight([0, 0], [SPEED, 0]),
        seed=2,
        sensor=replace(STEADY, full_scale_db=100.0),
        settings=TraceSettings(rays=256, max_bounces=1),
    )


@pytest.fixture(scope="module")
def scans(simulator: Simulator) -> list[PolarScan]:
    return [simulator.scan(k) for k in (0, 1)]


@pytest.fixture(scope="module")
def echoes(simulator: Simulator) -> Echoes:
    return simulator.echoes(0)


def mean_range(echoes: Echoes, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Mean range (A,) of the echoes of each azimuth, weighted by power, without speckle [m]."""
    near = ~echoes.sidelobe
    power = np.bincount(echoes.azimuth[near], echoes.mean_power[near], 400)
    moment = np.bincount(echoes.azimuth[near], echoes.mean_power[near] * echoes.range_m[near], 400)
    return moment[rows] / power[rows]


def ridge(scan: PolarScan, rows: NDArray[np.int64]) -> NDArray[np.float64]:
    """Range (A,) of the strongest peak of each azimuth: the power-weighted mean around it [m]."""
    power = 10 ** (decibels(scan.codes[rows]) / 10.0)
    ranges = (np.arange(power.shape[1]) + 0.5) * scan.bin_m
    power[:, ranges < 5.0] = 0
    near = np.abs(ranges - ranges[power.argmax(axis=1)][:, None]) < 0.5
    return (power * near * ranges).sum(axis=1) / (power * near).sum(axis=1)


def points(rows: NDArray[np.int64], range_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (A, 2) of azimuths as if the car were at rest: forward, right [m]."""
    angle = 2 * np.pi * rows / 400
    return range_m[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def compensated(seen: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (R, 2) [m] in the frame of mid-scan, by the speed of the car."""
    twist = np.array([SPEED, 0.0, 0.0])
    beta_s = STEADY.doppler_beta_s
    return to_mid_scan(
        seen, twist, revolution_s=1 / STEADY.rotation_hz, seam_rad=STEADY.seam_rad, doppler_beta_s=beta_s
    )


def off_line(places: NDArray[np.float64]) -> float:
    """Root mean square distance (N, 2) of places from the straight line that fits them best [m]."""
    centred = places - places.mean(axis=0)
    return float(np.linalg.svd(centred, compute_uv=False)[-1] / np.sqrt(len(places)))


def test_ego_motion_within_a_scan(law: LawRecorder, scans: list[PolarScan]) -> None:
    first, second = (scan.truth for scan in scans)
    assert first is not None
    assert second is not None
    law(
        "Distance from the first azimuth of a scan to that of the next at 15 m/s",
        source="15 m/s x 0.25 s",
        expected=3.75,
        simulated=float(np.linalg.norm(second.pose[0, :2] - first.pose[0, :2])),
        tolerance=1e-6,
        unit="m",
        why="a revolution without jitter",
    )


# Rows whose beam meets the wall well inside it; normal and distance of the wall from the origin.
WALLS = {
    "Wall ahead": (np.append(np.arange(360, 400), np.arange(41)), np.array([1.0, 0.0]), 45.0),
    "Slanted wall behind": (np.arange(205, 296), np.array([-1.0, 1.0]) / np.sqrt(2), 44.0 / np.sqrt(2)),
}


@pytest.mark.parametrize("name", list(WALLS))
def test_walls_bend_as_the_poses_predict_and_compensation_straightens_them(
    law: LawRecorder, echoes: Echoes, name: str
) -> None:
    rows, normal, distance_m = WALLS[name]
    found = mean_range(echoes, rows)
    seen = points(rows, found)
    # By hand: at time t the wall is (d - n v t) / (n u) away along the beam u; the rising sweep takes 0.049 s
    # times v u off.
    angle = -2 * np.pi * rows / 400
    beam = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    time_s = rows * 0.25 / 400
    range_m = (distance_m - normal[0] * SPEED * time_s) / (beam @ normal) - 0.049 * SPEED * beam[:, 0]
    predicted = range_m[:, None] * beam * [1, -1]  # x forward, y right
    law(
        f"{name} at 15 m/s, as if the car were at rest: distance from a straight line, root mean square",
        source="poses of the azimuths and beta v cos, by hand",
        expected=off_line(predicted),
        simulated=off_line(seen),
        tolerance=0.02,
        unit="m",
        why="a wall hit obliquely fills the beam over a metre of range; the mean is of some fifty rays",
    )
    straightened = compensated(seen)
    law(
        f"{name}, motion compensated: distance from a straight line, root mean square",
        source="it is straight",
        expected=0.0,
        simulated=off_line(straightened),
        tolerance=0.05,
        unit="m",
        why="a wall hit obliquely fills the beam over a metre of range; the mean is of some fifty rays",
    )
    middle_m = distance_m - normal[0] * SPEED * 199.5 * 0.25 / 400
    law(
        f"{name}, motion compensated: distance from the car at mid-scan",
        source="its true position",
        expected=middle_m,
        simulated=float(np.mean(straightened @ (normal * [1, -1]))),
        tolerance=0.1,
        unit="m",
        why="the wall is 8 m high: its top and bottom are farther by up to 0.2 m, weakened by the beam",
    )


def test_compensation_straightens_a_wall_in_the_codes(law: LawRecorder, scans: list[PolarScan]) -> None:
    rows = np.append(np.arange(375, 400), np.arange(26))  # 23 deg to each side
    seen = points(rows, ridge(scans[0], rows))
    assert off_line(seen) > 0.8
    straightened = compensated(seen)
    law(
        "Wall ahead in the written codes, motion compensated: distance of its ridge from a straight line",
        source="it is straight; as if the car were at rest, it is off by 0.9 m",
        expected=0.0,
        simulated=off_line(straightened),
        tolerance=0.15,
        unit="m",
        why="speckle moves the ridge within its 0.36 m, more where the wall is hit obliquely",
    )


def test_seam_ahead_jumps_by_the_ego_motion(law: LawRecorder, scans: list[PolarScan]) -> None:
    first, last = ridge(scans[0], np.array([4, 5, 6])), ridge(scans[0], np.array([394, 395, 396]))
    law(
        "Wall ahead: step between azimuths 5 and 395, on either side of straight ahead",
        source="15 m/s x 390 / 400 x 0.25 s, over the cosine of 4.5 deg",
        expected=SPEED * 390 / 400 * 0.25 / np.cos(np.radians(4.5)),
        simulated=float(first.mean() - last.mean()),
        tolerance=0.1,
        unit="m",
        why="speckle moves the ridge within its 0.36 m; mean of three azimuths",
    )
