"""The beam: its gain against its patterns, its measured widths, and both through the ray tracer."""

import math
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.interpolate import PchipInterpolator

from echoscape.scenes.core.scene import Mesh
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.cts350x import CTS350X
from tests.physics.laws import LawRecorder
from tests.physics.tracing import HEIGHT_M, facing, power_of, row_power, traced
from tests.sim.worlds import decibel, world

SECTION = "Antenna"
MEASURED = "point spread of raw Oxford scans"


def test_gain_is_what_the_patterns_integrate_to(law: LawRecorder) -> None:
    antenna = Antenna(replace(CTS350X, rotation_hz=1e-6))
    across = np.trapezoid(np.sqrt(antenna.azimuth_two_way), antenna.azimuth_grid_rad)
    elevation = antenna.elevation_grid_rad
    upright = np.trapezoid(antenna.elevation_one_way * np.cos(elevation), elevation)
    law(
        "Directivity of the patterns, 4 pi / integral of g dOmega, against the stated gain",
        source="IEEE Std 145-2013",
        expected=CTS350X.antenna_gain_db,
        simulated=float(decibel(4 * math.pi / (across * upright))),
        tolerance=0.1,
        unit="dBi",
        why="the gain is stated with two decimals",
    )


def two_way_energy_sr() -> float:
    """The integral of g^2 over the sphere, from the tables of the sensor alone, monotone between entries."""
    azimuth = np.radians(np.linspace(0, 180, 200_001))
    elevation = np.radians(np.linspace(-90, 90, 20_001))
    (offset, two_way), (angle, one_way) = (
        np.array(table).T for table in (CTS350X.azimuth_pattern_db, CTS350X.elevation_pattern_db)
    )
    mirrored = PchipInterpolator(np.append(-offset[:0:-1], offset), np.append(two_way[:0:-1], two_way))
    across = 10 ** (mirrored(np.degrees(azimuth)) / 10)
    upright = 10 ** (2 * PchipInterpolator(angle, one_way)(np.degrees(elevation)) / 10)
    return float(2 * np.trapezoid(across, azimuth) * np.trapezoid(upright * np.cos(elevation), elevation))


def test_rays_carry_the_energy_of_the_beam(law: LawRecorder) -> None:
    # In the middle of a rough sphere every direction returns alike: P = link rho f / R^2 x integral of g^2.
    # Soil met head on: |Gamma|^2 of eps = 3.0 - 0.11j; all of it diffuse (3 mm rms), f = 1 / pi.
    ball = trimesh.creation.icosphere(subdivisions=4, radius=20.0)
    sphere = Mesh(
        vertices=(np.asarray(ball.vertices) + np.array([0, 0, HEIGHT_M])).astype(np.float32),
        faces=ball.faces[:, ::-1].astype(np.uint32),
    )
    echoes = traced(world(("soil", "wall", sphere)), rays=256)
    found = np.mean([row_power(echoes, row) for row in range(60, 340)])
    epsilon = 3.0 - 17.98j * 0.00015 * 76.5**2.52 / 76.5
    gamma2 = abs((1 - np.sqrt(epsilon)) / (1 + np.sqrt(epsilon))) ** 2
    link = 0.02 * 10**5.5 * (299792458 / 76.5e9) ** 2 / (4 * math.pi) ** 2
    expected = link * gamma2 / math.pi / 20.0**2 * two_way_energy_sr()
    law(
        "Rough sphere around the radar: power of an azimuth",
        source="radar equation integrated over the two-way pattern",
        expected=float(decibel(expected / 1e-3)),
        simulated=float(decibel(found / 1e-3)),
        tolerance=0.15,
        unit="dBm",
        why="256 rays per azimuth; the sphere has flat faces of 1.4 m",
    )


@pytest.mark.parametrize(("level_db", "width_deg"), [(3, 1.1), (6, 1.7), (10, 2.3), (20, 3.9), (30, 5.8)])
def test_azimuth_lobe_has_the_measured_widths(law: LawRecorder, level_db: float, width_deg: float) -> None:
    antenna = Antenna(CTS350X)
    half = antenna.azimuth_grid_rad >= 0
    fall_db = -10 * np.log10(antenna.azimuth_two_way[half] / antenna.azimuth_two_way.max())
    law(
        f"Two-way azimuth lobe, full width at -{level_db} dB",
        source=MEASURED,
        expected=width_deg,
        simulated=2 * math.degrees(np.interp(level_db, fall_db, antenna.azimuth_grid_rad[half])),
        tolerance=0.1,
        unit="deg",
        why="the measured widths have one decimal",
    )


def test_rows_aside_hear_a_small_thing_by_the_azimuth_pattern(law: LawRecorder) -> None:
    thing = facing(math.pi / 2, 0.0, 40.0, 0.1, 1.0)  # 0.14 deg wide, at row 100
    echoes = traced(world(("soil", "target", thing)), sensor=replace(CTS350X, encoder_first=0))
    ahead = row_power(echoes, 100)
    half_widths = [0.55, 0.85, 1.15, 1.95, 2.9]
    for rows in (1, 2, 3):
        expected = np.interp(0.9 * rows, half_widths, [-3, -6, -10, -20, -30])
        found = [float(decibel(row_power(echoes, 100 + side * rows) / ahead)) for side in (-1, 1)]
        law(
            f"Echo of a small object {rows} azimuth{'s' if rows > 1 else ''} ({0.9 * rows:.1f} deg) off",
            source=MEASURED,
            expected=float(expected),
            simulated=float(np.mean(found)),
            tolerance=0.8,
            unit="dB",
            why="measured widths have one decimal: half of 0.1 deg on a flank of 13 dB per degree",
        )


def test_elevation_pattern_counts_twice(law: LawRecorder) -> None:
    # Plates that face the radar at 25 m, 6 of each elevation; the reference is in the beam's middle.
    levels = {0.0: 0.0, 3.0: -6.0, -3.0: -4.0, -5.0: -7.5, -10.0: -13.5}
    things = [
        (
            "soil",
            "target",
            facing(math.radians(10 + 55 * k + 9 * j), math.radians(elevation), 25.0, 0.8, 0.15),
        )
        for j, elevation in enumerate(levels)
        for k in range(6)
    ]
    echoes = traced(world(*things), rays=2048)
    power = np.array([power_of(echoes, 1 + i) for i in range(len(things))]).reshape(5, 6).mean(axis=1)
    for (elevation, one_way), found in list(zip(levels.items(), decibel(power / power[0]), strict=True))[1:]:
        law(
            f"Echo from {elevation:+.0f} deg of elevation against one from the middle of the beam",
            source=f"the one-way pattern, {one_way} dB, twice",
            expected=2 * one_way,
            simulated=float(found),
            tolerance=0.5,
            unit="dB",
            why="some hundred rays hit the plates, which are 0.3 deg high",
        )
