"""Coherent targets against the closed forms of their cross-sections (Knott, Radar Cross Section, ch. 5-6)."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIALS
from echoscape.scenes.core.scene import CLASSES
from echoscape.scenes.core.target_meshes import with_targets
from echoscape.scenes.core.targets import Target
from echoscape.sim.datasets.polar_scan import Component
from echoscape.sim.echoes import Echoes
from echoscape.sim.raytracing.surface.fresnel import permittivity
from echoscape.sim.raytracing.targets import route_sums
from echoscape.sim.raytracing.targets.physical_optics import surface_paths
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.physics.laws import LawRecorder
from tests.sim.worlds import Ride, decibel, plate, standing, straight, world

SECTION = "Link and cross-sections"
HEIGHT_M = CTS350X.mount_height_m
WAVELENGTH_M = 299_792_458 / 76.5e9
STEADY = replace(CTS350X, rotation_jitter_s=1e-9, encoder_first=0)
BARE = TraceSettings(rays=16, floor_db=-60.0)
ROW_RAD = 2 * math.pi / 400
FAR_M = 150.0


def echoes_of(*targets: Target, ride: Ride | None = None, things=(), settings=BARE) -> Echoes:
    town = with_targets(world(*things), targets)
    return Simulator(town, ride or standing(), seed=1, sensor=STEADY, settings=settings).echoes(0)


def ahead(kind: str, distance_m: float, *size_m: float, **more: Any) -> Target:
    """A target straight ahead at the antenna's height, facing it."""
    return Target(kind=kind, position_m=(distance_m, 0, HEIGHT_M), heading_rad=math.pi, size_m=size_m, **more)


def received_w(target: Target, row: int = 0) -> float:
    """Power of the echoes of an azimuth, added in phase."""
    echoes = echoes_of(target)
    return float(abs(echoes.amplitude[echoes.azimuth == row].astype(np.complex128).sum()) ** 2)


def radar_equation_w(sigma_m2: float, range_m: float) -> float:
    """Pt G^2 lambda^2 sigma / ((4 pi)^3 R^4 L) in mid-beam, from the sensor's data sheet."""
    gain = 10 ** ((2 * CTS350X.antenna_gain_db - CTS350X.system_loss_db) / 10)
    return CTS350X.tx_power_w * gain * WAVELENGTH_M**2 * sigma_m2 / ((4 * math.pi) ** 3 * range_m**4)


MID_BEAM_DB = float(decibel(received_w(ahead("point", FAR_M)) / radar_equation_w(1.0, FAR_M)))
"""Loss of a point in the middle of an azimuth by the rotation of the beam within a sweep."""


def cross_section_dbsm(target: Target, range_m: float) -> float:
    return float(decibel(received_w(target) / radar_equation_w(1.0, range_m))) - MID_BEAM_DB


CROSS_SECTIONS = [
    ("trihedral", (0.10,), "4 pi a^4 / (3 lambda^2)", 14.36, 0.15),
    ("trihedral", (0.15,), "4 pi a^4 / (3 lambda^2)", 21.40, 0.15),
    ("trihedral", (0.30,), "4 pi a^4 / (3 lambda^2)", 33.44, 0.15),
    ("plate", (0.10, 0.10), "4 pi A^2 / lambda^2", 19.13, 0.05),
    ("dihedral", (0.15, 0.15), "8 pi a^2 b^2 / lambda^2", 29.18, 0.1),
    ("sphere", (0.178,), "pi r^2", 10 * math.log10(math.pi * 0.178**2), 0.05),
    (
        "cylinder",
        (0.05, 0.30),
        "2 pi r h^2 / lambda",
        10 * math.log10(2 * math.pi * 0.05 * 0.09 / WAVELENGTH_M),
        0.15,
    ),
]


@pytest.mark.parametrize(("kind", "size_m", "formula", "dbsm", "tolerance_db"), CROSS_SECTIONS)
def test_cross_section(
    kind: str, size_m: tuple[float, ...], formula: str, dbsm: float, tolerance_db: float, law: LawRecorder
) -> None:
    why = {
        "trihedral": "phase front curved by 0.06 rad; 64 x 64 points per face: 0.1 dB; metal loses 0.03 dB",
        "plate": "phase front flat to 0.01 rad; metal loses 0.01 dB",
        "dihedral": "64 x 64 points per face; metal loses 0.02 dB",
        "sphere": "spherical wave: r / R, 0.01 dB",
        "cylinder": "phase front 0.24 rad curved at 150 m: 0.03 dB; points every 5 mm",
    }[kind]
    sizes = " x ".join(f"{size:g}" for size in size_m)
    law(
        f"{kind.capitalize()} of {sizes} m, {formula}",
        source="Knott, Radar Cross Section, 2012",
        expected=dbsm,
        simulated=cross_section_dbsm(ahead(kind, FAR_M, *size_m), FAR_M),
        tolerance=tolerance_db,
        unit="dBsm",
        why=why,
    )


@pytest.mark.parametrize(("kind", "size_m"), [("point", ()), ("trihedral", (0.1,))])
def test_power_of_a_target_falls_with_fourth_power_of_range(
    kind: str, size_m: tuple[float, ...], law: LawRecorder
) -> None:
    near, far = (received_w(ahead(kind, range_m, *size_m)) for range_m in (60.0, 120.0))
    law(
        f"{kind.capitalize()}: power per doubling of range, 60 to 120 m",
        source="radar equation, P ~ 1 / R^4",
        expected=-40 * math.log10(2),
        simulated=float(decibel(far / near)),
        tolerance=0.1,
        unit="dB",
        why="exact for a point; for a trihedral, its grid of points",
    )


def test_long_pole_falls_with_third_power_of_range(law: LawRecorder) -> None:
    # Many poles of different lengths, so that the ripple of their ends averages out.
    heights = np.linspace(6.0, 8.0, 11)
    near, far = (
        np.mean([received_w(ahead("cylinder", range_m, 0.05, float(height))) for height in heights])
        for range_m in (10.0, 20.0)
    )
    # Seen from nearer the beam is narrower on the pole, but wider than its Fresnel zone (0.2 m).
    law(
        "Smooth pole longer than its Fresnel zone: power per doubling of range",
        source="stationary phase in two planes, P ~ r / R^3",
        expected=-30 * math.log10(2),
        simulated=float(decibel(far / near)),
        tolerance=0.15,
        unit="dB",
        why="ends of 11 poles of 6-8 m ripple by some 0.1 dB; 10 m against 0.05 m of radius",
    )


@pytest.mark.parametrize(("size_m", "range_m"), [(2.0, 20.0), (2.0, 40.0), (4.0, 20.0), (8.0, 40.0)])
def test_large_plate_is_an_image(size_m: float, range_m: float, law: LawRecorder) -> None:
    sizes = np.linspace(0.85, 1.15, 7) * size_m
    powers = [received_w(ahead("plate", range_m, float(size), float(size))) for size in sizes]
    link = radar_equation_w(1.0, 1.0) * (4 * math.pi) ** 3 / WAVELENGTH_M**2
    image = link * (WAVELENGTH_M / (8 * math.pi * range_m)) ** 2
    law(
        f"Smooth metal plate of {size_m:g} m at {range_m:g} m, against its image (lambda / (8 pi R))^2",
        source="method of images; far field 2 D^2 / lambda = 2 km and more",
        expected=0.0,
        simulated=float(decibel(np.mean(powers) / image)) - MID_BEAM_DB,
        tolerance=0.3,
        unit="dB",
        why="edges ripple by some 0.3 dB, mean of seven sizes; the beam weakens outer Fresnel zones",
    )


@pytest.mark.parametrize(("size_m", "range_m"), [(1.0, 3.0), (4.0, 5.0), (6.0, 10.0)])
def test_sum_over_a_near_plate_is_the_integral(size_m: float, range_m: float, law: LawRecorder) -> None:
    # The square's integral is that of one edge squared but for cos and 1/R^2, near 1 where phases count:
    # take it whole, on a grid of a tenth of a wavelength of path from cell to cell.
    target = ahead("plate", range_m, size_m, size_m)
    paths = surface_paths(
        target,
        np.array([0.0, 0.0, HEIGHT_M]),
        wavelength_m=WAVELENGTH_M,
        epsilon=permittivity(MATERIALS["metal"], 76.5e9),
    )
    count = int(size_m**2 / range_m / WAVELENGTH_M * 10 / 2) * 2
    y = (np.arange(count) + 0.5) * (size_m / 2 / count)  # a quarter of the plate
    total = 0.0 + 0.0j
    for each in y:
        distance = np.sqrt(range_m**2 + each**2 + y**2)
        total += np.sum(range_m / distance**3 * np.exp(-4j * math.pi / WAVELENGTH_M * distance))
    total *= 4 * (size_m / 2 / count) ** 2
    law(
        f"Smooth metal plate of {size_m:g} m at {range_m:g} m, against the integral over it",
        source="physical optics, integrated on a dense grid",
        expected=0.0,
        simulated=float(decibel(np.abs(paths.amplitude.sum()) ** 2 / np.abs(total) ** 2)),
        tolerance=0.25,
        unit="dB",
        why="phase taken as linear in cells of a tenth of the first Fresnel zone; metal loses 0.01 dB",
    )


def test_target_too_near_has_no_echo_and_too_large_is_refused() -> None:
    for kind, size_m in (("point", ()), ("sphere", (0.3,)), ("cylinder", (0.1, 1.0)), ("plate", (0.5, 0.5))):
        assert len(echoes_of(Target(kind=kind, position_m=(0.05, 0.0, HEIGHT_M), size_m=size_m))) == 0
    above = Target(kind="cylinder", position_m=(0.0, 0.0, HEIGHT_M + 2.0), size_m=(0.05, 1.0))
    assert len(echoes_of(above)) == 0
    with pytest.raises(ValueError, match="too large to be summed from"):
        echoes_of(ahead("plate", 3.0, 150.0, 150.0))


def test_corner_is_one_target_at_its_apex(law: LawRecorder) -> None:
    target = ahead("trihedral", 60.0, 0.3)
    echoes = echoes_of(target, settings=TraceSettings())
    assert set(echoes.bounces) == {1}
    mid = echoes.azimuth == 0
    place = np.average(echoes.range_m[mid], weights=np.abs(echoes.amplitude[mid]) ** 2)
    law(
        "Trihedral of 0.3 m: range of its echo less that of its apex",
        source="every path of three bounces is as long as twice the distance to the apex",
        expected=0.0,
        simulated=place - 60.0,
        tolerance=0.002,
        unit="m",
        why="single and double bounces are nearer but 40 dB weaker",
    )
    artefacts = Artefacts(ghosts=False, thermal_noise=False)
    town = with_targets(world(), [target])
    with_ghosts, without = (
        Simulator(town, standing(), seed=1, sensor=STEADY, artefacts=each).scan(0)
        for each in (artefacts, replace(artefacts, ghosts=True))
    )
    np.testing.assert_array_equal(with_ghosts.codes, without.codes)
    assert without.truth is not None
    bin_ = int(60.0 / CTS350X.bin_m)
    assert without.truth.cells.component[0, bin_] == Component.DIRECT
    assert without.truth.cells.class_id[0, bin_] == CLASSES.index("target")
    assert abs(int(np.argmax(with_ghosts.codes[0])) - bin_) <= 1


def test_small_target_between_rays_is_received_in_full(law: LawRecorder) -> None:
    rng = np.random.default_rng(5)
    level = []
    for range_m, azimuth in zip(rng.uniform(20, 150, 8), rng.uniform(-3, 3, 8), strict=True):
        place = (range_m * math.cos(azimuth), -range_m * math.sin(azimuth), HEIGHT_M)
        echoes = echoes_of(Target(kind="sphere", position_m=place, size_m=(0.1,)))
        row = round(azimuth / ROW_RAD) % 400
        offset = azimuth - round(azimuth / ROW_RAD) * ROW_RAD
        power = float(abs(echoes.amplitude[echoes.azimuth == row].sum()) ** 2)
        lobe = 10 ** (-3 * (math.degrees(offset) / 0.55) ** 2 / 10)  # parabola in dB, -3 dB at 0.55 deg
        level.append(power / (radar_equation_w(math.pi * 0.01, range_m) * lobe))
    law(
        "Sphere of 0.1 m anywhere: power against the radar equation at the worst of eight positions",
        source="radar equation and the beam's shape",
        expected=0.0,
        simulated=float(np.max(np.abs(decibel(np.array(level)) - MID_BEAM_DB))),
        tolerance=0.3,
        unit="dB",
        why="here the lobe is a parabola in dB of the measured width",
    )


def test_phase_of_a_target_follows_the_radar(law: LawRecorder) -> None:
    ride = straight([0.0, 0.0], [15.0, 0.0])
    target = ahead("trihedral", 40.0, 0.2)
    echoes = echoes_of(target, ride=ride)
    errors = []
    for row in range(0, 4):
        inside = echoes.azimuth == row
        position = 15.0 * 0.25 / 400 * row
        expected = -4 * math.pi * (40.0 - position) / WAVELENGTH_M
        found = np.angle(echoes.amplitude[inside].astype(np.complex128).sum())
        errors.append(math.remainder(found - expected, 2 * math.pi))
    law(
        "Trihedral from a radar at 15 m/s: change of phase from azimuth to azimuth less 4 pi dr / lambda",
        source="two-way path",
        expected=0.0,
        simulated=float(np.max(np.abs(np.diff(errors)))),
        tolerance=0.05,
        unit="rad",
        why="single bounces, 30 dB weaker, change phase faster",
    )


def test_sum_is_renewed_often_enough_while_the_radar_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    target = Target(
        kind="plate", position_m=(12.0, 5.0, HEIGHT_M), heading_rad=math.pi + 0.4, size_m=(0.3, 0.3)
    )
    ride = straight([0.0, 0.0], [15.0, 0.0])
    usual = by_row(echoes_of(target, ride=ride))
    monkeypatch.setattr(route_sums, "_MOST_PHASE", 0.0)  # a sum for every azimuth of the main lobe
    exact = by_row(echoes_of(target, ride=ride))
    loud = exact > exact.max() * 1e-3
    assert loud.sum() >= 5
    np.testing.assert_allclose(decibel(usual[loud] / exact[loud]), 0, atol=0.7)


def by_row(echoes: Echoes) -> NDArray[np.float64]:
    total = np.zeros(400, np.complex128)
    np.add.at(total, echoes.azimuth, echoes.amplitude)
    return np.abs(total) ** 2


def test_targets_hide_and_are_hidden() -> None:
    wall = ("concrete", "wall", plate([30.0, 0.0, HEIGHT_M], [-1, 0], 4.0, 4.0))
    behind = echoes_of(ahead("trihedral", 50.0, 0.2), things=(wall,))
    assert not (behind.instance == 2).any()
    before = echoes_of(ahead("trihedral", 20.0, 0.2), things=(wall,))
    assert (before.instance == 2).any()
    screen = ahead("plate", 10.0, 3.0, 3.0)
    shaded = echoes_of(
        screen, things=(wall,), settings=TraceSettings(rays=256, floor_db=-60.0, max_bounces=1)
    )
    ahead_rows = np.isin(shaded.azimuth, [399, 0, 1]) & ~shaded.sidelobe
    assert not (shaded.instance[ahead_rows] == 1).any()


def test_plate_seen_from_behind_is_a_plate_and_edge_on_next_to_nothing() -> None:
    front = received_w(ahead("plate", 60.0, 0.2, 0.2))
    turned = Target(kind="plate", position_m=(60.0, 0, HEIGHT_M), heading_rad=0.0, size_m=(0.2, 0.2))
    assert decibel(received_w(turned) / front) == pytest.approx(0, abs=0.01)
    edge = Target(
        kind="plate", position_m=(60.0, 0, HEIGHT_M), heading_rad=math.pi / 2 + 0.01, size_m=(0.2, 0.2)
    )
    assert decibel(received_w(edge) / front) < -40


def test_plate_has_the_sidelobes_of_its_aperture(law: LawRecorder) -> None:
    # 1.43 half periods of the sinc off: the first sidelobe, -13.26 dB.
    angle = 1.4303 * WAVELENGTH_M / (2 * 0.2)
    side = Target(
        kind="plate", position_m=(FAR_M, 0, HEIGHT_M), heading_rad=math.pi + angle, size_m=(0.2, 0.2)
    )
    law(
        "Plate of 0.2 m: first sidelobe as it is rotated",
        source="sinc^2 of a square aperture",
        expected=-13.26,
        simulated=float(decibel(received_w(side) / received_w(ahead("plate", FAR_M, 0.2, 0.2)))),
        tolerance=0.15,
        unit="dB",
        why="phase front 0.1 rad curved at 150 m",
    )


def test_glass_target_is_weaker_by_fresnel(law: LawRecorder) -> None:
    glass = Target(
        kind="plate",
        position_m=(FAR_M, 0, HEIGHT_M),
        heading_rad=math.pi,
        size_m=(0.1, 0.1),
        material="glass",
    )
    law(
        "Plate of glass against one of metal",
        source="ITU-R P.2040-3: |Gamma|^2 of glass at 76.5 GHz, -7.31 dB, of metal -0.01 dB",
        expected=-7.30,
        simulated=float(decibel(received_w(glass) / received_w(ahead("plate", FAR_M, 0.1, 0.1)))),
        tolerance=0.02,
        unit="dB",
        why="two decimals",
    )
