"""Phase noise, compression, clipping, converter and thermal noise, measured on simulated beat tones."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.sim.echoes import point_echoes
from echoscape.sim.receiver.if_signal import beat, echo_grid
from echoscape.sim.receiver.phase_noise import modulated, modulation, phase_noise
from echoscape.sim.receiver.receiver import PART_STEP, Received, convert, receive
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.link_budget import full_scale_amplitude
from echoscape.sim.settings.artefacts import Artefacts
from tests.physics.laws import LawRecorder

SECTION = "Receiver"
FLAT = replace(CTS350X, range_gain_db=((0.0, 0.0), (163.0, 0.0)), sweep_ripple_db=())
FEW = replace(FLAT, azimuths=8)
CORRELATION = "4 sin^2(pi f tau), Budge & Burt, IEEE RADAR 1993"
CLEAN = Artefacts(thermal_noise=False, leakage=False, phase_noise=False, saturation=False, quantisation=False)


def grid(range_m: list[float], power_w: list[float], azimuths: int) -> NDArray[np.complex64]:
    """Echoes that are the same at every azimuth."""
    echoes = point_echoes(
        azimuth=np.repeat(np.arange(azimuths), len(range_m)),
        range_m=np.tile(range_m, azimuths),
        amplitude=np.sqrt(np.tile(power_w, azimuths)),
        azimuths=azimuths,
    )
    return echo_grid(echoes, replace(FLAT, azimuths=azimuths))


def received(range_m: list[float], power_w: list[float], artefacts: Artefacts, sensor=FEW) -> Received:
    rngs = [np.random.default_rng(k) for k in (0, 1)]
    echoes = grid(range_m, power_w, sensor.azimuths)
    return receive(echoes, sensor, artefacts, noise_rng=rngs[0], phase_rng=rngs[1])


def skirt_db(range_m: float) -> float:
    """Level of a tone's sideband 100 kHz above it, against the synthesiser's own there [dB].

    Only noise between 80 and 120 kHz is left in: a real beat signal folds the lower sideband at 0 Hz, and the
    far parts of it would lie on the upper one.
    """
    rows, count, rate = 400, 2048, FLAT.sample_hz
    drawn = np.fft.rfft(phase_noise(FLAT, azimuths=rows, count=count, rng=np.random.default_rng(7)))
    drawn[:, np.abs(np.fft.rfftfreq(count, 1 / rate) - 100e3) > 20e3] = 0
    phase = np.fft.irfft(drawn).astype(np.float32)
    tone = grid([range_m], [1.0], rows)
    clean = beat(tone, FLAT).astype(np.float64)
    error = modulated(tone, FLAT, modulation(phase, FLAT)).real - clean
    window, size = np.blackman(FLAT.samples), 1 << 15
    first = count // 2 - FLAT.samples // 2
    own = np.fft.rfft(phase[:, first : first + FLAT.samples] * window, size)
    beside = np.fft.rfft(error * window, size)
    carrier = np.abs(np.fft.rfft(clean[0] * window, size))
    centre, (low, high) = int(np.argmax(carrier)), (round(f / rate * size) for f in (97e3, 103e3))
    sideband = np.mean(np.abs(beside[:, centre + low : centre + high]) ** 2) / carrier.max() ** 2
    return float(10 * np.log10(sideband * window.sum() ** 2 / np.mean(np.abs(own[:, low:high]) ** 2)))


@pytest.mark.parametrize(("range_m", "factor_db"), [(5, -33.6), (50, -13.6), (160, -3.6)])
def test_phase_noise_is_correlated_by_range(law: LawRecorder, range_m: int, factor_db: float) -> None:
    tau = 2 * range_m / 299792458
    assert 10 * math.log10(4 * math.sin(math.pi * 100e3 * tau) ** 2) == pytest.approx(factor_db, abs=0.05)
    law(
        f"Phase noise 100 kHz beside a tone at {range_m} m, against the synthesiser's",
        source=CORRELATION,
        expected=factor_db,
        simulated=skirt_db(range_m),
        tolerance=0.2,
        unit="dB",
        why="400 drawn azimuths; a sweep of 0.4 ms resolves some 8 kHz; the delay counts from half a bin",
    )


def test_skirts_grow_with_the_strength_of_the_target(law: LawRecorder) -> None:
    artefacts = replace(CLEAN, phase_noise=True)
    skirts = []
    for power_w in (1e-12, 1e-10):
        found = received([50.0], [power_w], artefacts)
        aside = slice(round(65 / FLAT.bin_m / PART_STEP), round(75 / FLAT.bin_m / PART_STEP))
        skirts.append(found.distortion[:, aside].mean(dtype=np.float64))
    law(
        "Skirt of a target that is 20 dB stronger",
        source="sidebands are relative to their tone",
        expected=20.0,
        simulated=float(10 * np.log10(skirts[1] / skirts[0])),
        tolerance=0.05,
        unit="dB",
        why="the same draws of phase; samples of 16 bits",
    )


def test_compression_weakens_an_echo_by_1_db_at_its_stated_power(law: LawRecorder) -> None:
    at = (1000 + 0.5) * FEW.bin_m

    def gain_db(above_db: float) -> float:
        power_w = 10 ** ((FEW.compression_dbm + above_db - 30) / 10)
        linear, found = (
            received([at], [power_w], replace(CLEAN, saturation=each)).power[0, 1000]
            for each in (False, True)
        )
        return float(10 * np.log10(found / linear))

    why = "aliases of the grid of echoes, -50 dB at the ends of a sweep"
    law(
        "Echo at the 1-dB compression point: level against a linear receiver's",
        source="definition of the point",
        expected=-1.0,
        simulated=gain_db(0),
        tolerance=0.005,
        unit="dB",
        why=why,
    )
    for above_db, tolerance in ((-40.0, 1e-4), (10.0, 0.01), (40.0, 0.01)):
        # Rapp's curve with p = 1 through the 1-dB point: the gain in power is 1 / (1 + (10^0.1 - 1) P / P1).
        expected = -10 * math.log10(1 + (10**0.1 - 1) * 10 ** (above_db / 10))
        law(
            f"Echo {above_db:+g} dB from the 1-dB compression point, the same",
            source="Rapp 1991 with p = 1",
            expected=expected,
            simulated=gain_db(above_db),
            tolerance=tolerance,
            unit="dB",
            why=why,
        )


def test_compressed_echo_has_no_harmonics() -> None:
    # Its envelope is constant, and harmonics of the carrier are outside the band. Hann's sidelobes are 100 dB
    # down at 40 resolution cells; a clipping converter would give -9.5 and -14 dB.
    power_w = 10 ** ((FEW.compression_dbm + 20 - 30) / 10)
    found = received([20.0], [power_w], replace(CLEAN, saturation=True)).power[0]
    beyond = found[round(20.0 / FEW.bin_m) + 40 * 6 :]
    assert 10 * np.log10(beyond.max() / found.max()) < -95


def test_two_echoes_intermodulate_as_the_curve_says(law: LawRecorder) -> None:
    # Rapp's curve with p = 1 begins as s (1 - |s|^2 / 2 A^2): two tones of amplitude a give a^3 / 2 A^2 at
    # 2 f1 - f2. A^2 = a1^2 / (10^0.1 - 1) for the 1-dB point a1.
    down_db, (near, far) = -30.0, (1000, 1300)
    power_w = 10 ** ((FEW.compression_dbm + down_db - 30) / 10)
    ranges = [(k + 0.5) * FEW.bin_m for k in (near, far)]
    found = received(ranges, [power_w, power_w], replace(CLEAN, saturation=True)).power[0]
    law(
        "Third-order product of two echoes 30 dB below the 1-dB compression point, against one of them",
        source="cubic term of Rapp's curve, p = 1",
        expected=20 * math.log10((10**0.1 - 1) * 10 ** (down_db / 10) / 2),
        simulated=float(10 * np.log10(found[2 * near - far] / found[near])),
        tolerance=0.1,
        unit="dB",
        why="terms of fifth order 30 dB below; samples of 16 bits",
    )


def test_clipped_tone_becomes_a_square_wave(law: LawRecorder) -> None:
    strong = full_scale_amplitude(FEW) ** 2
    found = received([20.0], [strong], replace(CLEAN, saturation=1000.0)).power[0]
    near = [slice(round(k * 20.0 / FEW.bin_m) - 10, round(k * 20.0 / FEW.bin_m) + 10) for k in (1, 3, 5)]
    peaks = [found[part].max() for part in near]
    for order, name, level_db in ((1, "Third", -9.54), (2, "Fifth", -13.98)):
        assert 20 * math.log10(1 / (2 * order + 1)) == pytest.approx(level_db, abs=0.005)
        law(
            f"{name} harmonic of a tone clipped hard",
            source="Fourier series of a square wave, 1 / n",
            expected=level_db,
            simulated=float(10 * np.log10(peaks[order] / peaks[0])),
            tolerance=0.3,
            unit="dB",
            why="peaks lie between bins; harmonics beyond half the sampling rate fold back",
        )
        place = (np.argmax(found[near[order]]) + near[order].start + 0.5) * FEW.bin_m
        law(
            f"{name} harmonic of a clipped target at 20 m: false target",
            source=f"{2 * order + 1} times the beat frequency",
            expected=20.0 * (2 * order + 1),
            simulated=float(place),
            tolerance=(order + 0.5) * FEW.bin_m,
            unit="m",
            why="ranges count from half a bin before frequency 0; half a bin",
        )


def test_clipping_raises_the_floor_of_its_row() -> None:
    # Two tones mix in the clipping converter; away from them the row rises to a multiple of what it was.
    strong = 4 * full_scale_amplitude(FEW) ** 2
    ranges = [20.0, 33.7, 41.1, 77.7]
    clips = replace(FEW, compression_dbm=100.0)  # only the converter is driven too far
    clipped = received(ranges, [strong] * 4, replace(CLEAN, saturation=True, thermal_noise=True), clips)
    alone = received([], [], replace(CLEAN, thermal_noise=True))
    assert np.median(clipped.power[:, 2500:]) > 100 * np.median(alone.power[:, 2500:])


@pytest.mark.parametrize("bits", [8, 10, 12])
def test_converter_noise(law: LawRecorder, bits: int) -> None:
    sensor = replace(FEW, adc_bits=bits)
    tone = (full_scale_amplitude(sensor) * np.sin(np.arange(200_000) * 0.1234567)).astype(np.float32)[None]
    converted, _ = convert(tone, sensor, replace(CLEAN, quantisation=True))
    error = (converted.amplitude() - tone).astype(np.float64)
    law(
        f"Signal to quantisation noise of {bits} bits",
        source="6.02 b + 1.76 dB (Bennett 1948)",
        expected=6.02 * bits + 1.76,
        simulated=10 * math.log10(np.mean(tone.astype(np.float64) ** 2) / np.mean(error**2)),
        tolerance=0.1,
        unit="dB",
        why="a sine spends more time near its peaks: some 0.05 dB at 8 bits",
    )


def test_noise_floor(law: LawRecorder) -> None:
    # What power at the antenna peaks as high as the mean of the noise: k T0 B F, B = 1.5 / T for Hann.
    power_w, at = 1e-11, (1000 + 0.5) * FLAT.bin_m
    peak = received([at], [power_w], CLEAN).power[0, 1000]
    noise = received([], [], replace(CLEAN, thermal_noise=True), sensor=FLAT).power
    sweep_s = 0.049 * 636e6 / 76.5e9
    floor_w = 1.380649e-23 * 290 * 10**1.5 * 1.5 / sweep_s
    law(
        "Noise floor of the written scan, as power at the antenna",
        source="k T0 B F, F = 15 dB, B = 1.5 / T (Hann)",
        expected=10 * math.log10(floor_w / 1e-3),
        simulated=10 * math.log10(power_w * noise.mean(dtype=np.float64) / peak / 1e-3),
        tolerance=0.05,
        unit="dBm",
        why="250 000 independent draws: 0.01 dB; a remainder of the sweep of less than two samples is unused",
    )
    law(
        "Mean of the thermal noise in written power",
        source="quiet azimuths of raw Oxford scans at far range",
        expected=1.57,
        simulated=float(noise.mean(dtype=np.float64)),
        tolerance=0.016,
        why="250 000 independent draws: 0.2 %",
    )
    law(
        "Mean over standard deviation of the noise's power",
        source="a complex Gaussian's squared magnitude is exponential",
        expected=1.0,
        simulated=float(noise.mean(dtype=np.float64) / noise.std(dtype=np.float64)),
        tolerance=0.01,
        why="250 000 independent draws",
    )
