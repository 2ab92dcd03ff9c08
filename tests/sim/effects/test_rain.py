"""Rain: attenuation by ITU-R P.838, drops by Mie, and their echoes in a scan."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mesh
from echoscape.sim.datasets.polar_scan import Component, PolarScan
from echoscape.sim.effects.rain import (
    drops,
    mie_cross_sections,
    rain_gain,
    rain_grid,
    rain_power_w,
    specific_attenuation_db_km,
    water_permittivity,
)
from echoscape.sim.raytracing.scan_state import scan_state
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import decibel, plate, quad, standing, world

SMALL = replace(CTS350X, azimuths=8)
Thing = tuple[str, str, Mesh]
QUIET = {"leakage": False, "phase_noise": False, "saturation": False}


@pytest.mark.parametrize(
    ("ghz", "k", "alpha"),
    # ITU-R P.838-3, Table 5, vertical polarisation.
    [(10, 0.01129, 1.2156), (35, 0.3224, 0.8761), (80, 1.1668, 0.7021)],
)
def test_attenuation_is_that_of_the_recommendations_table(ghz: float, k: float, alpha: float) -> None:
    at = {rate: specific_attenuation_db_km(rate, ghz * 1e9) for rate in (1.0, 10.0)}
    assert at[1.0] == pytest.approx(k, rel=2e-3)
    assert math.log10(at[10.0] / at[1.0]) == pytest.approx(alpha, abs=2e-4)


def test_small_drops_are_rayleighs() -> None:
    wavelength_m, size_m = 299792458 / 76.5e9, 0.04e-3
    epsilon = water_permittivity(76.5e9)
    factor = (epsilon - 1) / (epsilon + 2)
    back, extinction = mie_cross_sections(size_m, 76.5e9)
    assert back == pytest.approx(math.pi**5 * abs(factor) ** 2 * size_m**6 / wavelength_m**4, rel=0.02)
    absorbed = math.pi**2 * size_m**3 / wavelength_m * -factor.imag
    assert extinction == pytest.approx(absorbed, rel=0.02)


def test_large_drops_take_twice_their_shadow() -> None:
    """The extinction paradox: a drop of many wavelengths takes 2 pi r^2 (Bohren & Huffman, ch. 4.4.3)."""
    size_m = 0.2
    _, extinction = mie_cross_sections(size_m, 76.5e9)
    # The edge adds some x^(-2/3), here 3 %, and more.
    assert extinction == pytest.approx(2 * math.pi * (size_m / 2) ** 2, rel=0.1)


@pytest.mark.parametrize("size_mm", [0.1, 0.5, 1.0, 2.0, 3.0, 5.0])
def test_drop_sends_back_no_more_than_it_takes(size_mm: float) -> None:
    back, extinction = mie_cross_sections(size_mm * 1e-3, 76.5e9)
    assert 0 < back < 4 * extinction  # radar cross-sections count 4 pi times what goes straight back
    assert extinction > 0


def test_water_is_that_of_the_static_and_the_optical_limit() -> None:
    # ITU-R P.840-8: at 10 deg C 77.66 + 103.3 (300 / 283.15 - 1) = 83.81 at rest;
    # far above both relaxations 3.52.
    assert water_permittivity(1e6).real == pytest.approx(83.81, abs=0.01)
    assert water_permittivity(1e15).real == pytest.approx(3.52, abs=0.01)
    assert water_permittivity(76.5e9).imag < 0


@pytest.mark.parametrize("rate", [5.0, 12.5, 25.0, 50.0])
def test_drops_take_what_the_recommendation_says(rate: float) -> None:
    """Marshall and Palmer's drops against fits to measured rain: they agree within 35 %."""
    assert drops(rate, 76.5e9)[1] == pytest.approx(specific_attenuation_db_km(rate, 76.5e9), rel=0.35)


def test_reflectivity_is_about_that_of_the_drops_shadows() -> None:
    """At 76.5 GHz most of the drops' area is of drops of about a wavelength around (Mie's resonances)."""
    eta = {rate: drops(rate, 76.5e9)[0] for rate in (1.0, 5.0, 25.0, 100.0)}
    assert sorted(eta.values()) == list(eta.values())
    # At 25 mm/h: 8000 / (m^3 mm) exp(-2.086 D / mm) pi D^2 / 4, summed: 8000 pi / 4 x 2 / 2.086^3 mm^2/m^3.
    assert abs(decibel(eta[25.0] / 1.38e-3)) < 3


def test_way_there_and_back_is_twice_one_way() -> None:
    lost_db = -2 * decibel(rain_gain(np.array([0.0, 250.0, 1000.0]), 80.0, replace(CTS350X, carrier_hz=80e9)))
    np.testing.assert_allclose(lost_db, np.array([0, 0.5, 2]) * 1.1668 * 80**0.7021, rtol=3e-3)


def whole_beam(sensor: Sensor, rate: float) -> NDArray[np.float32]:
    """Mean power of rain (azimuths, bins / 2) for an unobstructed beam."""
    clear = np.ones((sensor.azimuths, sensor.fft_size // 4), np.float32)
    return rain_power_w(sensor, Antenna(sensor), rate_mm_h=rate, clear=clear)


def test_power_falls_with_the_square_of_range_and_the_way() -> None:
    power = whole_beam(SMALL, 20.0)[0]
    ranges = (20.0, 40.0, 80.0)
    at = {range_m: power[round((range_m / SMALL.bin_m - 0.5) / 2)] for range_m in ranges}
    for near, far in pairwise(ranges):
        # 1.13 x 20^0.71 = 9.5 dB/km at 76.5 GHz, there and back
        fall_db = 6.02 + 2 * 9.5e-3 * (far - near)
        assert decibel(at[near] / at[far]) == pytest.approx(fall_db, abs=0.03)


def test_rain_is_drawn_anew_with_its_mean_power() -> None:
    power = np.tile(whole_beam(SMALL, 20.0), (50, 1))[:, 50:1500]
    grids = [rain_grid(power, rng=np.random.default_rng(seed)) for seed in (1, 1, 2)]
    np.testing.assert_array_equal(grids[0], grids[1])
    assert (np.abs(grids[0]) ** 2 / power).mean() == pytest.approx(1.0, abs=0.01)
    coherence = abs(np.vdot(grids[0], grids[2])) / np.linalg.norm(grids[0]) / np.linalg.norm(grids[2])
    assert coherence < 0.02


def test_objects_on_the_vehicle_attenuate_rain_as_well() -> None:
    blocked = replace(SMALL, blocking_db=((0.0, 20.0), (100.0, 20.0), (100.1, 0.0), (360.0, 0.0)))
    lost_db = decibel(whole_beam(SMALL, 20.0)[:, 500] / whole_beam(blocked, 20.0)[:, 500])
    np.testing.assert_allclose(lost_db, [20, 20, 20, 0, 0, 0, 0, 0], atol=1e-3)  # a azimuth every 45 deg


def clear_share(*objects: Thing, rays: int = 256) -> NDArray[np.float32]:
    """Share of the beam that reaches each decimetre (400, 4000)."""
    made = Simulator(world(*objects), standing(), seed=4, settings=TraceSettings(rays=rays))
    revolution, dry = made.revolution(0), Artefacts()
    poses, movers = made._timeline.poses(revolution, dry), made._timeline.movers(revolution, dry)
    state = scan_state(made._scene, index=0, revolution=revolution, poses=poses, movers=movers)
    return made._tracer.clear_share(made._tracer.launch(state), np.arange(4000, dtype=np.float64) * 0.1)


def test_road_takes_the_lower_part_of_the_beam() -> None:
    clear = clear_share(
        ("asphalt", "road", quad([[-500, -500, 0], [500, -500, 0], [500, 500, 0], [-500, 500, 0]]))
    )
    assert clear[:, :20].min() == 1.0  # the road begins two metres below
    assert (np.diff(clear, axis=1) <= 0).all()
    antenna = Antenna(CTS350X)
    angle = antenna.elevation_grid_rad
    weight = antenna.elevation_one_way**2 * np.cos(angle)
    for range_m in (5.0, 20.0, 100.0):
        above = np.sin(angle) > -CTS350X.mount_height_m / range_m
        share = weight[above].sum() / weight.sum()
        assert clear[:, round(range_m * 10)].mean() == pytest.approx(share, abs=0.02)


def test_house_hides_the_rain_behind_it() -> None:
    house = ("concrete", "building", plate([30, 0, 0], [-1, 0], 30, 60))
    clear = clear_share(house)
    assert clear[0, 295] > 0.99
    assert clear[0, 305] < 0.02
    assert clear[200, 305] > 0.99
    truth = scanned(40.0, house).truth
    assert truth is not None
    rain = truth.cells.component[:, 730:1100] == Component.RAIN  # 31.5 to 47.5 m
    assert rain[0].mean() < 0.05
    assert rain[200].mean() > 0.7


def scanned(rain: float, *objects: Thing) -> PolarScan:
    return Simulator(
        world(*objects),
        standing(),
        seed=4,
        settings=TraceSettings(rays=64),
        artefacts=Artefacts(rain=rain, **QUIET),
    ).scan(0)


def test_near_cells_are_rain_and_far_ones_are_as_without() -> None:
    dry, wet = scanned(0.0), scanned(40.0)
    assert wet.truth is not None
    near, far = slice(40, 80), slice(3000, 3768)
    received = wet.codes[:, near] > 0
    component = wet.truth.cells.component[:, near]
    assert received.mean() > 0.9
    assert (component[received] == Component.RAIN).mean() > 0.85
    assert not wet.truth.cells.instance[wet.truth.cells.component == Component.RAIN].any()
    share = [(wet.truth.cells.component[:, part] == Component.RAIN).mean() for part in (near, far)]
    assert share[1] < share[0] - 0.3  # by 130 m it comes down to the noise
    assert (dry.codes[:, near] > 0).mean() < 0.6


def test_wall_is_as_much_fainter_as_rain_takes() -> None:
    wall = ("concrete", "building", plate([100, 0, 5], [-1, 0], 60, 10))
    clear, heavy = (scanned(rate, wall).codes[:20, 2300:2330].astype(float) for rate in (0.0, 100.0))
    strong = clear > 40
    assert strong.sum() > 50
    # 1.13 x 100^0.71 = 29 dB/km at 76.5 GHz, between the table's 70 and 80 GHz; there and back 5.9 dB.
    lost_db = np.median((clear - heavy)[strong]) / 2
    assert lost_db == pytest.approx(5.9, abs=0.5)


def test_sidelobes_of_a_strong_target_are_no_rain() -> None:
    """What is far stronger than the rain of its cell is not called rain."""
    wall = ("metal", "building", plate([20, 0, 2], [-1, 0], 3, 4))
    scan = scanned(0.2, wall)
    assert scan.truth is not None
    beside = scan.truth.cells.component[0, 470:500]  # the ripple's sidelobes, a metre behind the wall
    strong = scan.codes[0, 470:500] > 60
    assert strong.any()
    assert not (beside[strong] == Component.RAIN).any()
