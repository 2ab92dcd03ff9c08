"""Interference: crossings against chirps mixed and filtered sample by sample, Friis, sight and draws."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mesh, Mover
from echoscape.sim.datasets.polar_scan import Component
from echoscape.sim.effects.echo_filter import Selection
from echoscape.sim.effects.interference import (
    ChirpRadar,
    crossings,
    drawn_radar,
    interference,
    received_share,
)
from echoscape.sim.kinematics.rolling_scan import AzimuthPoses
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.cir304 import CIR304_RT
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts
from echoscape.sim.settings.tracing import TraceSettings
from echoscape.sim.simulator import Simulator
from tests.sim.worlds import box_prototype, decibel, mover, plate, standing, world

RADAR = ChirpRadar(
    slope_hz_s=10e12, duration_s=50e-6, period_s=70e-6, start_s=13e-6, first_hz=CTS350X.carrier_hz - 300e6
)
TIMES_S = np.array([0.0100, 0.0107])
FINER = 512
"""Samples of the plain mixer to one of the converter's: 1.9 GHz."""


def two_rows(sensor: Sensor) -> Sensor:
    return replace(sensor, azimuths=2)


def mixed(sensor: Sensor, azimuth: int) -> NDArray[np.complex128]:
    """Each chirp of RADAR times the sweep of a azimuth, low-passed at fs / 2: (chirps, samples)."""
    samples, rate_hz = sensor.samples, sensor.sample_hz * FINER
    t = (np.arange(samples * FINER) - samples * FINER // 2) / rate_hz
    slope = sensor.slope_hz_s * (1 if sensor.rising[azimuth] else -1)
    found = []
    for number in range(400):
        begin = RADAR.start_s + number * RADAR.period_s - TIMES_S[azimuth]
        sent = (t >= begin) & (t <= begin + RADAR.duration_s)
        if not sent.any():
            continue
        s = t - begin
        # From the frequency at s = 0 on; whole cycles of the carrier before it are a constant phase.
        cycles = (RADAR.first_hz - sensor.carrier_hz) * s + RADAR.slope_hz_s * s**2 / 2 - slope * t**2 / 2
        spectrum = np.fft.fft(np.where(sent, np.exp(2j * np.pi * cycles), 0))
        kept = np.concatenate([spectrum[: samples // 2], spectrum[-samples // 2 :]]) / FINER
        found.append(np.fft.ifft(kept))
    return np.array(found)


@pytest.mark.parametrize(
    ("sensor", "azimuth"), [(CTS350X, 0), (CTS350X, 1), (CIR304_RT, 0), (CIR304_RT, 1)], ids=str
)
def test_beat_is_that_of_a_plain_mixer(sensor: Sensor, azimuth: int) -> None:
    """But for each chirp's phase, which is drawn: found by least squares."""
    sensor, power_w = two_rows(replace(sensor, carrier_hz=CTS350X.carrier_hz)), 3e-12
    beats = interference(
        RADAR, sensor, power_w=np.full(2, power_w), times_s=TIMES_S, rng=np.random.default_rng(1)
    )
    plain = mixed(sensor, azimuth)
    basis = np.concatenate([plain.real, -plain.imag])
    weights, *_ = np.linalg.lstsq(basis.T, beats[azimuth].astype(np.float64), rcond=None)
    rest = beats[azimuth] - weights @ basis
    # The ends of a chirp splatter over all frequencies: some per cent of the energy.
    assert np.sum(rest**2) < 0.05 * np.sum(beats[azimuth] ** 2)
    crossing = np.sum(np.abs(plain) ** 2, axis=1) > 0.5 * sensor.sample_hz**2 / (RADAR.slope_hz_s * 2)
    size = np.hypot(*weights.reshape(2, -1))[crossing]
    assert len(size) == np.isfinite(crossings(RADAR, sensor, TIMES_S)[azimuth]).sum() >= 3
    np.testing.assert_allclose(size, math.sqrt(2 * power_w), rtol=0.1)


@pytest.mark.parametrize("rising", [True, False])
def test_crossing_brings_its_power_for_the_time_in_the_band(rising: bool) -> None:
    sensor = two_rows(replace(CTS350X, chirps="rising" if rising else "falling"))
    power_w = np.array([2e-12, 0.0])
    times_s = TIMES_S + (0 if rising else 15e-6)  # so that no crossing is cut by the sweep's ends
    drawn = [np.random.default_rng(seed) for seed in range(60)]
    beats = [interference(RADAR, sensor, power_w=power_w, times_s=times_s, rng=rng) for rng in drawn]
    when = crossings(RADAR, sensor, times_s)[0]
    count = np.isfinite(when).sum()
    assert np.nanmax(abs(when)) < sensor.sweep_s / 2 - 2e-6
    relative = 10e12 - 1.5612e12 * (1 if rising else -1)  # 76.5 GHz / 0.049 s
    expected = count * 2e-12 * sensor.sample_hz * (sensor.sample_hz / relative)
    # A real pulse's energy hangs on its phase: sixty draws of three crossings or more.
    energy = np.mean([np.sum(each[0].astype(np.float64) ** 2) for each in beats])
    assert energy == pytest.approx(expected, rel=0.05)
    assert not any(each[1].any() for each in beats)


@pytest.mark.parametrize("name", SENSORS)
def test_at_a_crossing_both_have_one_frequency(name: str) -> None:
    sensor = SENSORS[name]
    radar = drawn_radar(sensor, seed=3, instance=11)
    times_s = 0.1 + np.arange(sensor.azimuths, dtype=np.float64) * 625e-6
    when = crossings(radar, sensor, times_s)
    azimuth, _ = np.nonzero(np.isfinite(when))
    assert len(azimuth) > sensor.azimuths
    t = when[np.isfinite(when)]
    phase_s = np.remainder(times_s[azimuth] + t - radar.start_s, radar.period_s)
    assert (phase_s <= radar.duration_s + 1e-9).all()
    own = sensor.carrier_hz + np.where(sensor.rising[azimuth], 1, -1) * sensor.slope_hz_s * t
    np.testing.assert_allclose(radar.first_hz + radar.slope_hz_s * phase_s, own, atol=1e4)
    assert (abs(t) < sensor.sweep_s / 2).all()


AHEAD = replace(CTS350X, encoder_first=0)
"""Its first azimuth looks straight ahead."""


def share_of(place: list[float], yaw: float, sensor: Sensor = AHEAD) -> NDArray[np.float64]:
    azimuths = sensor.azimuths
    poses = AzimuthPoses(
        position=np.zeros((azimuths, 3)),
        yaw=np.zeros(azimuths),
        tilt=np.zeros((azimuths, 2)),
        velocity=np.zeros((azimuths, 3)),
        azimuth_period_s=625e-6,
    )
    return received_share(
        np.tile(place, (azimuths, 1)), np.full(azimuths, yaw), poses, sensor, Antenna(sensor)
    )


def test_power_is_that_of_friis() -> None:
    # 35.15 dBi, lambda = 3.919 mm, 50 m: 20 log10(lambda / (4 pi R)) = -104.10 dB; half of 15.3 dB is lost.
    found_db = decibel(share_of([50.0, 0.0, 0.0], math.pi)[0])
    # The beam turns by 0.55 deg within a sweep, which takes 0.2 dB of its peak one way.
    assert found_db == pytest.approx(35.15 - 104.10 - 7.65 - 0.2, abs=0.05)
    # Turned by 35 deg it sends half, turned away a thousandth.
    assert decibel(share_of([50.0, 0.0, 0.0], math.pi - math.radians(35))[0]) == pytest.approx(
        found_db - 3.01, abs=0.01
    )
    assert decibel(share_of([50.0, 0.0, 0.0], 0.0)[0]) == pytest.approx(found_db - 30, abs=0.01)


def test_beam_is_one_way_and_follows_the_azimuths() -> None:
    share = share_of([0.0, -50.0, 0.0], math.pi / 2)  # to the right: azimuth 100 looks there
    assert share.argmax() == 100
    # Two-way -20 dB at 1.872 deg is -10 dB one way: 2 azimuths aside are 1.8 deg.
    assert decibel(share[102] / share[100]) == pytest.approx(-9.6, abs=0.8)


def test_objects_on_the_vehicle_cause_half_their_two_way_loss() -> None:
    sensor = replace(AHEAD, blocking_db=((0.0, 12.0), (360.0, 12.0)))
    ratio = share_of([50.0, 0.0, 0.0], math.pi, sensor) / share_of([50.0, 0.0, 0.0], math.pi)
    np.testing.assert_allclose(decibel(ratio), -6.0, atol=1e-6)


# ---------------------------------------------------------------------- in a scan

CAR = box_prototype("box", (4.0, 1.8, 1.5), "metal")


def facing(instance: int, x: float, y: float) -> Mover:
    """A car at (x, y) that looks at the radar."""
    return mover(instance, CAR, standing(x, y, yaw=math.atan2(-y, -x)))


def simulator(
    movers: list[Mover], *objects: tuple[str, str, Mesh], eirp_w: float, **artefacts: float | bool
) -> Simulator:
    return Simulator(
        world(*objects),
        standing(),
        movers,
        seed=6,
        settings=TraceSettings(rays=16),
        artefacts=Artefacts(interference=eirp_w, **artefacts),
    )


def added(made: Simulator) -> NDArray[np.float32]:
    """What other radars add to the beat signals of scan 0."""
    propagation = made._propagate(0, [made.artefacts], Selection())
    found = made._interference(propagation, made.artefacts)
    assert found is not None
    return found


def test_azimuths_that_look_there_rise_and_are_labelled() -> None:
    # At 30 m 3 mW are 29 dB above the noise while in the band, for some hundredth of a sweep.
    quiet, interfered = (simulator([facing(5, 30, 0)], eirp_w=each).scan(0) for each in (0.0, 0.06))
    rise_db = (interfered.codes[:, 1500:3500].astype(float) - quiet.codes[:, 1500:3500]).mean(axis=1) / 2
    # Azimuth 399 looks along 359.94 deg.
    assert rise_db[[399, 0]].min() > 3
    assert np.abs(rise_db[20:380]).max() < 0.5
    assert interfered.truth is not None
    named = (interfered.truth.cells.component == Component.INTERFERENCE)[:, 1500:3500].mean(axis=1)
    assert named[399] > 0.5
    assert named[20:380].max() < 0.01


def test_vehicle_behind_a_house_does_not_interfere() -> None:
    wall = ("concrete", "building", plate([15, 0, 5], [-1, 0], 20, 20))
    assert added(simulator([facing(5, 30, 0)], eirp_w=10.0)).any()
    assert not added(simulator([facing(5, 30, 0)], wall, eirp_w=10.0)).any()


def test_vehicle_far_beyond_the_range_interferes() -> None:
    assert added(simulator([facing(5, 300, 0)], eirp_w=10.0)).any()


def test_rain_attenuates_one_way() -> None:
    dry, wet = (added(simulator([facing(5, 200, 0)], eirp_w=1.0, rain=each)) for each in (0.0, 100.0))
    # 29 dB/km over 198 m
    assert decibel(np.sum(dry**2) / np.sum(wet**2)) == pytest.approx(5.9, abs=0.5)


def test_draws_of_a_vehicle_do_not_depend_on_the_others() -> None:
    cars = [facing(5, 30, 0), facing(6, 0, 30), facing(7, -30, 1)]
    alone = [added(simulator([each], eirp_w=1.0)) for each in cars]
    together = added(simulator(cars, eirp_w=1.0))
    reversed_order = added(simulator(cars[::-1], eirp_w=1.0))
    size = np.abs(together).max()
    assert np.abs(together - sum(alone)).max() < 1e-5 * size
    assert np.abs(together - reversed_order).max() < 1e-5 * size
    assert np.abs(alone[0] - alone[1]).max() > 0.1 * size


def test_power_is_proportional_to_eirp() -> None:
    one, four = (added(simulator([facing(5, 30, 0)], eirp_w=each)) for each in (1.0, 4.0))
    azimuths = one.any(axis=1)
    np.testing.assert_allclose(four[azimuths], 2 * one[azimuths], rtol=1e-4, atol=1e-5 * np.abs(four).max())
