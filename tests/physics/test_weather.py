"""Rain and the radars of others, against recommendations and numbers worked out by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from echoscape.sim.effects.interference import ChirpRadar, interference, received_share
from echoscape.sim.effects.rain import (
    drops,
    mie_cross_sections,
    rain_grid,
    rain_power_w,
    specific_attenuation_db_km,
    water_permittivity,
)
from echoscape.sim.kinematics.rolling_scan import AzimuthPoses
from echoscape.sim.receiver.receiver import receive
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.link_budget import units_per_watt
from echoscape.sim.settings.artefacts import Artefacts
from tests.physics.laws import LawRecorder
from tests.sim.worlds import decibel

SECTION = "Weather and interference"
FLAT = replace(CTS350X, range_gain_db=((0.0, 0.0), (163.0, 0.0)), sweep_ripple_db=())
CLEAN = Artefacts(thermal_noise=False, leakage=False, phase_noise=False, saturation=False, quantisation=False)
P838 = "ITU-R P.838-3, Table 5, vertical polarisation"


@pytest.mark.parametrize(
    ("ghz", "k", "alpha"), [(10, 0.01129, 1.2156), (35, 0.3224, 0.8761), (80, 1.1668, 0.7021)]
)
def test_specific_attenuation(law: LawRecorder, ghz: int, k: float, alpha: float) -> None:
    one, ten = (specific_attenuation_db_km(rate, ghz * 1e9) for rate in (1.0, 10.0))
    law(
        f"Attenuation of rain of 1 mm/h at {ghz} GHz, k",
        source=P838,
        expected=k,
        simulated=one,
        tolerance=2e-3 * k,
        unit="dB/km",
        why="the table has four to five digits of its own fits",
    )
    law(
        f"Exponent of the rain rate at {ghz} GHz, alpha",
        source=P838,
        expected=alpha,
        simulated=math.log10(ten / one),
        tolerance=2e-4,
        why="the table has four decimals",
    )


def test_small_drop(law: LawRecorder) -> None:
    wavelength_m, size_m = 299792458 / 76.5e9, 0.04e-3
    epsilon = water_permittivity(76.5e9)
    factor = (epsilon - 1) / (epsilon + 2)
    rayleigh = math.pi**5 * abs(factor) ** 2 * size_m**6 / wavelength_m**4
    law(
        "Radar cross-section of a drop of 0.04 mm by Mie's series",
        source="Rayleigh: pi^5 |K|^2 D^6 / lambda^4",
        expected=float(decibel(rayleigh)),
        simulated=float(decibel(mie_cross_sections(size_m, 76.5e9)[0])),
        tolerance=0.1,
        unit="dBsm",
        why="the next term goes with (pi D / lambda)^2 = 0.001 times some ten for water",
    )


def test_extinction_of_drops(law: LawRecorder) -> None:
    law(
        "Attenuation of rain of 25 mm/h, sum over its drops",
        source="ITU-R P.838-3 against Mie on the drops of Marshall & Palmer 1948",
        expected=float(decibel(specific_attenuation_db_km(25.0, 76.5e9))),
        simulated=float(decibel(drops(25.0, 76.5e9)[1])),
        tolerance=1.3,
        unit="dB of dB/km",
        why="drop sizes vary from rain to rain; both fits are to other measurements",
    )


def test_rain_clutter(law: LawRecorder) -> None:
    """eta dV in a range cell of 1.5 c / 2B, with the beam's solid angle, put into the radar equation."""
    clear = np.ones((FLAT.azimuths, FLAT.fft_size // 4), np.float32)
    power_w = rain_power_w(FLAT, Antenna(FLAT), rate_mm_h=10.0, clear=clear)
    grid = rain_grid(power_w, rng=np.random.default_rng(1))
    rngs = [np.random.default_rng(k) for k in (2, 3)]
    written = receive(grid, FLAT, CLEAN, noise_rng=rngs[0], phase_rng=rngs[1]).power
    found = {}
    for range_m in (25.0, 50.0):
        at = slice(round((range_m - 1) / FLAT.bin_m), round((range_m + 1) / FLAT.bin_m))
        found[range_m] = float(decibel(written[:, at].mean() / units_per_watt(FLAT)))
    gain, loss, wavelength_m = 10**3.515, 10**1.53, 299792458 / 76.5e9
    volume_m3 = Antenna(FLAT).two_way_energy_sr * 25.0**2 * 1.5 * 299792458 / (2 * 636e6)
    section = drops(10.0, 76.5e9)[0] * volume_m3
    expected = 0.02 * gain**2 * wavelength_m**2 * section / ((4 * math.pi) ** 3 * 25.0**4 * loss)
    lost_db = 2 * 0.025 * specific_attenuation_db_km(10.0, 76.5e9)
    law(
        "Echo of rain of 10 mm/h in a range cell at 25 m",
        source="radar equation with sigma = eta R^2 Omega 1.5 c / 2B (Hann), and the attenuation of the rain",
        expected=float(decibel(expected)) - lost_db,
        simulated=found[25.0],
        tolerance=0.2,
        unit="dBW",
        why="2 m of range at 400 azimuths: some 2000 draws, 0.1 dB; the mean of 1 / R^2 over them",
    )
    law(
        "Fall of rain's echo from 25 to 50 m",
        source="a filled beam: 20 log10(2), and 50 m of rain",
        expected=6.02 + 2 * lost_db / 2,
        simulated=found[25.0] - found[50.0],
        tolerance=0.3,
        unit="dB",
        why="two means of some 2000 draws each",
    )


def test_energy_of_a_crossing(law: LawRecorder) -> None:
    sensor, rows = CTS350X, CTS350X.azimuths
    radar = ChirpRadar(
        slope_hz_s=10e12, duration_s=50e-6, period_s=1.0, start_s=0.0, first_hz=sensor.carrier_hz - 250e6
    )
    beats = interference(
        radar,
        sensor,
        power_w=np.full(rows, 1e-12),
        times_s=np.full(rows, 25e-6),
        rng=np.random.default_rng(1),
    )
    band_s = sensor.sample_hz / (10e12 - 76.5e9 / 0.049)
    law(
        "Energy of a chirp of 10 MHz/us that crosses a sweep, over that of a microsecond",
        source="its power for the time in the band, fs / |S - s| (Brooker, IEEE Trans. EMC 49(1), 2007)",
        expected=float(decibel(band_s * 1e6)),
        simulated=float(decibel(np.sum(beats**2) / rows / sensor.sample_hz / 1e-12 * 1e6)),
        tolerance=0.1,
        unit="dB",
        why="a pulse of two samples: its real part depends on its phase, drawn 400 times",
    )


def test_friis(law: LawRecorder) -> None:
    rows = CTS350X.azimuths
    poses = AzimuthPoses(
        position=np.zeros((rows, 3)),
        yaw=np.zeros(rows),
        tilt=np.zeros((rows, 2)),
        velocity=np.zeros((rows, 3)),
        azimuth_period_s=0.0,
    )
    place = np.tile([50.0, 0.0, 0.0], (rows, 1))
    sensor = replace(CTS350X, encoder_first=0)  # its first azimuth looks at the other radar
    share = received_share(place, np.full(rows, math.pi), poses, sensor, Antenna(sensor))
    law(
        "Received over radiated power of another radar at 50 m",
        source="Friis: G (lambda / (4 pi R))^2 over half the two-way loss: 35.15 - 104.10 - 7.65 dB",
        expected=-76.60,
        simulated=float(decibel(share[0])),
        tolerance=0.25,
        unit="dB",
        why="the beam rotates by 0.55 deg within a sweep: 0.2 dB of its peak",
    )
