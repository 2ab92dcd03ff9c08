"""How echoes fall with range, by what fills the beam: through rays, the receiver and the written power."""

import math
from dataclasses import replace

import numpy as np
import pytest

from echoscape.scenes.core.target_meshes import with_targets
from echoscape.scenes.core.targets import Target
from echoscape.sim.echoes import Echoes
from echoscape.sim.receiver.if_signal import echo_grid
from echoscape.sim.receiver.receiver import receive
from echoscape.sim.settings.artefacts import Artefacts
from tests.physics.laws import LawRecorder
from tests.physics.tracing import HEIGHT_M, POINTING, WAVELENGTH_M, facing, power_of, row_power, traced
from tests.sim.worlds import decibel, world

SECTION = "Link and cross-sections"
RADAR_EQUATION = "P = Pt G^2 lambda^2 sigma / ((4 pi)^3 R^4)"
CLEAN = Artefacts(thermal_noise=False, leakage=False, phase_noise=False, saturation=False, quantisation=False)


def test_point_target_falls_by_12_db_a_doubling(law: LawRecorder) -> None:
    # Four points of 10 m2 at right angles, traced and received.
    flat = replace(POINTING, range_gain_db=((0.0, 0.0), (163.0, 0.0)), full_scale_db=150.0)
    ranges = (20.0, 40.0, 80.0, 160.0)
    points = [
        Target(
            kind="point",
            position_m=(r * math.cos(k * math.pi / 2), -r * math.sin(k * math.pi / 2), HEIGHT_M),
            rcs_m2=10.0,
        )
        for k, r in enumerate(ranges)
    ]
    echoes = traced(with_targets(world(), points), rays=16, sensor=flat)
    rngs = [np.random.default_rng(k) for k in (0, 1)]
    power = receive(echo_grid(echoes, flat), flat, CLEAN, noise_rng=rngs[0], phase_rng=rngs[1]).power
    peaks = [
        power[100 * k, round(r / flat.bin_m) - 12 : round(r / flat.bin_m) + 12].max()
        for k, r in enumerate(ranges)
    ]
    law(
        "Point target, written power: fall per doubling of range, 20 to 160 m",
        source=RADAR_EQUATION,
        expected=-12.04,
        simulated=float(decibel(peaks[-1] / peaks[0]) / 3),
        tolerance=0.1,
        unit="dB",
        why="peaks lie between bins: up to 0.05 dB",
    )


def test_long_pole_falls_by_9_db_a_doubling(law: LawRecorder) -> None:
    # Rough posts 0.2 m wide and 120 m tall: they fill the beam in elevation only. Eight of each distance.
    distances = (20.0, 40.0, 80.0)
    posts = [
        ("soil", "target", facing(math.radians(4 + 15 * j + 45 * k), 0.0, distance, 0.2, 120.0))
        for j, distance in enumerate(distances)
        for k in range(8)
    ]
    echoes = traced(world(*posts))
    power = np.array([power_of(echoes, i + 1) for i in range(24)]).reshape(3, 8).mean(axis=1)
    law(
        "Long rough pole: fall per doubling of range, 20 to 80 m",
        source="area in the beam grows with R",
        expected=-9.03,
        simulated=float(decibel(power[2] / power[0]) / 2),
        tolerance=0.3,
        unit="dB",
        why="some hundred rays hit a pole at 80 m",
    )


def walls(material: str, distance_m: float) -> Echoes:
    """Echoes of eight walls around the radar, 33 deg wide, at normal incidence at every 50th azimuth."""
    size = 0.6 * distance_m
    faces = [facing(k * math.pi / 4, 0.0, distance_m, size, size) for k in range(8)]
    rays = 256 if material == "soil" else 1024  # few meet the flash of a mirror
    return traced(world(*((material, "wall", face) for face in faces)), rays=rays, floor_db=-30.0)


@pytest.mark.parametrize(("name", "material"), [("Rough", "soil"), ("Mirror", "glass")])
def test_walls_that_fill_the_beam_fall_by_6_db_a_doubling(law: LawRecorder, name: str, material: str) -> None:
    level = {}
    for distance in (20.0, 40.0):
        echoes = walls(material, distance)
        level[distance] = np.mean([row_power(echoes, 50 * k) for k in range(8)])
        if material == "soil":
            level[-distance] = np.sort(echoes.mean_power)[-100:].mean()
    law(
        f"{name} wall that fills the beam: fall from 20 to 40 m",
        source="area in the beam grows with R^2" if material == "soil" else "power of an image at 2 R",
        expected=-6.02,
        simulated=float(decibel(level[40.0] / level[20.0])),
        tolerance=0.05,
        unit="dB",
        why="the same rays hit both walls",
    )
    if material == "soil":
        law(
            "A patch's return: fall from 20 to 40 m",
            source="rays are drawn from the beam, so that only the path back spreads: 1/R^2",
            expected=-6.02,
            simulated=float(decibel(level[-40.0] / level[-20.0])),
            tolerance=0.15,
            unit="dB",
            why="patches twice as wide, of as many rays; the strongest hundred",
        )
    else:
        # (lambda / (8 pi R))^2 |Gamma|^2 (1 - S^2), S = 0.05, of eps = 6.31 - 0.282j; G and losses: 55 dB.
        gamma2 = abs((1 - np.sqrt(6.31 - 0.282j)) / (1 + np.sqrt(6.31 - 0.282j))) ** 2
        image = 0.02 * 10**5.5 * (WAVELENGTH_M / (8 * math.pi * 40.0)) ** 2 * gamma2 * (1 - 0.05**2)
        # Slopes of 3 mrad spread the flash over a beam that falls by 3 dB in 0.53 deg, two-way.
        spread = 1 / math.sqrt(1 + 2 * math.log(2) * (math.degrees(0.003) / 0.53) ** 2)
        law(
            "Glass wall at 40 m: received power",
            source="its image, Pt G^2 (lambda / (8 pi R))^2 |Gamma|^2, 0.3 dB less for its surface slopes",
            expected=float(decibel(image * spread / 1e-3)),
            simulated=float(decibel(level[40.0] / 1e-3)),
            tolerance=0.3,
            unit="dBm",
            why="few rays hit the specular area, 0.2 deg wide; mean of eight walls",
        )
