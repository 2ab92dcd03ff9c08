"""The sweep: beat frequency, range resolution, place and shape of a point's peak, Doppler."""

import math
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.sim.echoes import point_echoes
from echoscape.sim.receiver.if_signal import beat, echo_grid, spectrum
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.sensor import Sensor
from tests.physics.laws import LawRecorder
from tests.physics.tracing import HEIGHT_M, STEADY, traced
from tests.sim.worlds import plate, straight, world

SECTION = "FMCW"
HARRIS = "Harris, Proc. IEEE 66(1), 1978"
ONE_ROW = replace(CTS350X, azimuths=1, sweep_ripple_db=())
FINE = replace(ONE_ROW, bins=4 * CTS350X.bins, bin_m=CTS350X.bin_m / 4, fft_size=4 * CTS350X.fft_size)
"""Four times as many bins, so that the shape of a peak can be read off."""
CELL_M = 299792458 / 2 / 636e6
SWEEP_S = 0.049 * 636e6 / 76.5e9  # beta B / f0
Window = Literal["hann", "hamming", "blackman", "boxcar"]


def sweep(range_m: float | np.floating, sensor: Sensor) -> NDArray[np.float32]:
    """The beat signal (1, samples) of an echo of 1 W."""
    echo = point_echoes(
        azimuth=np.zeros(1), range_m=np.array([range_m]), amplitude=np.ones(1), azimuths=sensor.azimuths
    )
    return beat(echo_grid(echo, sensor), sensor)


def power(range_m: float | np.floating, sensor: Sensor) -> NDArray[np.float64]:
    return np.abs(spectrum(sweep(range_m, sensor), sensor)[0].astype(np.complex128)) ** 2


def peak_place(profile: NDArray[np.float64]) -> float:
    """Where a profile peaks, in bins: a parabola through the logarithm of three."""
    k = int(np.argmax(profile))
    low, middle, high = np.log(profile[k - 1 : k + 2])
    return k + 0.5 * (low - high) / (low - 2 * middle + high)


def frequency_hz(signal: NDArray[np.float32], rate_hz: float) -> float:
    """The frequency of a tone, by a transform of its own."""
    size = 1 << 18
    transform = np.abs(np.fft.rfft(signal[0] * np.hanning(signal.shape[1]), size))
    return peak_place(transform) * rate_hz / size


def test_beat_frequency(law: LawRecorder) -> None:
    found = [frequency_hz(sweep(r, ONE_ROW), ONE_ROW.sample_hz) for r in (40.0, 140.0)]
    law(
        "Beat frequency of 100 m of range",
        source="2 B r / (c T)",
        expected=2 * 636e6 * 100.0 / (299792458 * SWEEP_S) / 1e3,
        simulated=(found[1] - found[0]) / 1e3,
        tolerance=0.05,
        unit="kHz",
        why="0.01 bins",
    )


def test_range_resolution(law: LawRecorder) -> None:
    # Without a window, a point's spectrum has its first zero one resolution cell from the peak.
    sensor = replace(FINE, window="boxcar")
    profile = power(80.0, sensor)
    peak = peak_place(profile)
    k = int(peak)
    zeros = [k + n for n in range(5, 40) if profile[k + n] < profile[k + n - 1 : k + n + 2 : 2].min()]
    law(
        "Range resolution: first zero of an unweighted point",
        source="c / 2B",
        expected=CELL_M,
        simulated=(zeros[0] - peak) * sensor.bin_m,
        tolerance=0.006,
        unit="m",
        why="half a bin of 0.0108 m",
    )


def test_points_peak_where_they_are(law: LawRecorder) -> None:
    ranges = np.append(np.linspace(1.0, 161.9, 300), (np.arange(500, 3500, 100) + 0.99) * 0.0432)
    profiles = [power(r, ONE_ROW) for r in ranges]
    wrong = sum(int(np.argmax(p)) != math.floor(r / 0.0432) for p, r in zip(profiles, ranges, strict=True))
    off = [(peak_place(p) + 0.5) * 0.0432 - r for p, r in zip(profiles, ranges, strict=True)]
    law(
        "Points whose peak is not in their bin, of 330 from 1 to 162 m",
        source="bin k spans k to k + 1 times 0.0432 m",
        expected=0,
        simulated=wrong,
        tolerance=0,
        why="every one",
    )
    law(
        "Position of the peak of a point between bins, largest error",
        source="f = 2 B r / (c T)",
        expected=0.0,
        simulated=float(np.abs(off).max()) * 1e3,
        tolerance=2.0,
        unit="mm",
        why="a parabola through three bins; at 1 m the mirror image at -1 m adds to it",
    )


COSINES = {"hann": (0.5, 0.5), "hamming": (0.54, 0.46), "blackman": (0.42, 0.5, 0.08)}


def continuous_width(name: Window) -> float:
    """-3 dB width of a window's transform in cells, from its cosine sum."""
    parts = COSINES[name]

    def level_db(x: float) -> float:
        total = sum(a / 2 * (np.sinc(x - k) + np.sinc(x + k)) for k, a in enumerate(parts))
        return 20 * math.log10(float(total) / parts[0]) + 3.0103

    offsets = np.linspace(0.4, 1.1, 7001)
    return 2 * float(np.interp(0.0, [-level_db(x) for x in offsets], offsets))


@pytest.mark.parametrize(
    ("name", "sidelobe_db", "width", "noise_cells"),
    [("hann", -31.5, 1.44, 1.50), ("hamming", -42.7, 1.30, 1.36), ("blackman", -58.1, 1.64, 1.73)],
)
def test_windows(
    law: LawRecorder, name: Window, sidelobe_db: float, width: float, noise_cells: float
) -> None:
    assert continuous_width(name) == pytest.approx(width, abs=0.005)
    sensor = replace(FINE, window=name)
    profile = power(80.0, sensor)
    level_db = 10 * np.log10(np.maximum(profile / profile.max(), 1e-12))
    peak = int(np.argmax(profile))
    cells = (np.arange(len(profile)) - peak_place(profile)) * sensor.bin_m / CELL_M
    falling = (cells > 0) & (cells < 1.2)
    half = np.interp(3.0103, -level_db[falling], cells[falling])
    past = np.flatnonzero(np.diff(level_db[peak:]) > 0)[0] + peak
    title = name.capitalize()
    law(
        f"{title} window, highest sidelobe of a point",
        source=HARRIS,
        expected=sidelobe_db,
        simulated=float(level_db[past : past + 400].max()),
        tolerance=0.2,
        unit="dB",
        why="the expected value has one decimal; sampled at 23 bins per resolution cell",
    )
    law(
        f"{title} window, -3 dB width of a point",
        source=f"{HARRIS}; transform of its cosine sum",
        expected=width,
        simulated=2 * float(half),
        tolerance=0.01,
        unit="cells of c / 2B",
        why="the expected value has two decimals",
    )
    # White noise of variance 1 has the mean sum w^2, an echo of 1 W peaks with (sum w)^2 / 2.
    rng = np.random.default_rng(5)
    noisy = replace(CTS350X, azimuths=400, window=name, sweep_ripple_db=())
    noise = rng.standard_normal((400, noisy.samples)).astype(np.float32)
    floor = np.mean(np.abs(spectrum(noise, noisy)[:, 100:-100]) ** 2, dtype=np.float64)
    law(
        f"{title} window, noise bandwidth",
        source=HARRIS,
        expected=noise_cells,
        simulated=float(floor * noisy.samples / (2 * profile.max())),
        tolerance=0.02,
        unit="cells of c / 2B",
        why="400 azimuths of noise: 0.1 %; the peak is up to half a bin of 0.0108 m off",
    )


def test_doppler(law: LawRecorder) -> None:
    town = world(("soil", "target", plate([40.0, 0, HEIGHT_M], [-1, 0], 0.5, 0.5)))
    ride = straight([0, 0], [15.0, 0])
    plain, shifted = (
        traced(town, ride, rays=256, sensor=STEADY, floor_db=-20.0, doppler=on) for on in (False, True)
    )
    mean = [np.average(echoes.range_m, weights=echoes.mean_power) for echoes in (plain, shifted)]
    law(
        "Range shift of a target approached at 15 m/s, rising sweep",
        source="-beta v, beta = 0.049 s (Burnett et al., RA-L 2021)",
        expected=-0.735,
        simulated=float(mean[1] - mean[0]),
        tolerance=0.001,
        unit="m",
        why="cosine of the angle to a plate of 0.5 m",
    )


def test_paired_echoes(law: LawRecorder) -> None:
    """A ripple of p periods in a sweep makes sidelobes p cells to each side."""
    ripple = ((8.0, -30.0), (20.0, -40.0))
    profile = power(80.0, replace(FINE, sweep_ripple_db=ripple))
    peak = peak_place(profile)
    for cells, level_db in ripple:
        place = peak + cells * CELL_M / FINE.bin_m
        near = profile[round(place) - 20 : round(place) + 21]
        law(
            f"Sidelobe of a ripple of {cells:g} periods in a sweep",
            source="paired echoes, Klauder et al., Bell System Technical Journal 39(4), 1960",
            expected=level_db,
            simulated=float(10 * np.log10(near.max() / profile.max())),
            tolerance=0.2,
            unit="dB",
            why="the window's own sidelobes there are 45 dB and more below it",
        )
        law(
            f"Its range, {cells:g} cells from the target",
            source="paired echoes, Klauder et al., Bell System Technical Journal 39(4), 1960",
            expected=cells * CELL_M,
            simulated=(peak_place(near) + round(place) - 20 - peak) * FINE.bin_m,
            tolerance=0.02,
            unit="m",
            why="two bins of 0.0108 m: sidelobes of the window shift it",
        )
