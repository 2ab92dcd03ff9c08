"""Compression leaves weak echoes alone, keeps their order, and ends at a ceiling."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from echoscape.sim.receiver.compression import compression_gain, one_db_amplitude, saturation_amplitude
from echoscape.sim.sensor.cir204 import CIR204
from echoscape.sim.sensor.cir304 import CIR304, CIR304_RT
from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.link_budget import full_scale_amplitude, units_per_watt
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts
from tests.sim.receiver.received import QUIET, SENSOR, received, tones

LIMIT = saturation_amplitude(CTS350X)
ONE_DB_W = 10 ** (SENSOR.compression_dbm / 10 - 3)


def output(envelope: float) -> float:
    gain = compression_gain(np.array([[envelope]], np.complex64), LIMIT)
    return float(gain[0, 0]) * envelope


def test_envelope_of_a_tone_at_the_stated_power_leaves_1_db_weaker() -> None:
    # A tone of P watts has the amplitude sqrt(2 P).
    assert one_db_amplitude(CTS350X) == pytest.approx(math.sqrt(2 * 10 ** (-61.6 / 10) * 1e-3), rel=1e-12)
    assert output(one_db_amplitude(CTS350X)) == pytest.approx(
        one_db_amplitude(CTS350X) * 10 ** (-1 / 20), rel=1e-6
    )


@given(low_db=st.floats(-120, 60), more_db=st.floats(0.001, 60), angle=st.floats(0, 7))
def test_output_grows_with_input_and_stays_below_both_input_and_ceiling(
    low_db: float, more_db: float, angle: float
) -> None:
    low, high = (LIMIT * 10 ** (level / 20) for level in (low_db, low_db + more_db))
    assert output(low) < output(high) * (1 + 1e-6)
    assert output(high) <= min(high, LIMIT) * (1 + 1e-6)
    turned = compression_gain(np.array([[high * np.exp(1j * angle)]], np.complex64), LIMIT)[0, 0]
    assert turned == pytest.approx(output(high) / high, rel=1e-5)


@pytest.mark.parametrize(
    ("sensor", "largest_code"), [(CTS350X, 136), (CIR204, 135), (CIR304, 158), (CIR304_RT, 160)]
)
def test_ceiling_lies_just_above_the_largest_code_of_real_scans(sensor: Sensor, largest_code: int) -> None:
    ceiling_db = 10 * math.log10(ceiling_w(sensor) * units_per_watt(sensor))
    assert largest_code / 2 < ceiling_db < largest_code / 2 + 3
    assert full_scale_amplitude(sensor) > saturation_amplitude(sensor)  # the converter is not clipped


def ceiling_w(sensor: Sensor) -> float:
    return saturation_amplitude(sensor) ** 2 / 2


def level_db(power_w: float, artefacts: Artefacts) -> float:
    return float(10 * np.log10(received(*tones(40.0, power_w), artefacts).power.max()))


def test_scans_of_weak_echoes_keep_their_power() -> None:
    on, off = replace(QUIET, saturation=1.0), QUIET
    weak_w = ONE_DB_W * 1e-4
    assert level_db(weak_w, on) == pytest.approx(level_db(weak_w, off), abs=5e-4)


@pytest.mark.parametrize("strength", [0.1, 0.5, 1.0])
def test_strength_moves_the_compression_point(strength: float) -> None:
    power_w = ONE_DB_W / strength**2
    found = level_db(power_w, replace(QUIET, saturation=strength)) - level_db(power_w, QUIET)
    assert found == pytest.approx(-1, abs=0.01)


def test_strength_of_zero_is_the_limit_of_small_ones() -> None:
    power_w = 100 * ONE_DB_W
    assert level_db(power_w, replace(QUIET, saturation=1e-3)) == pytest.approx(
        level_db(power_w, QUIET), abs=1e-3
    )


def test_converter_clips_from_a_strength_of_1_3_on() -> None:
    # The strongest envelope that leaves the compressing stage against the level at which the converter clips.
    assert full_scale_amplitude(CTS350X) / LIMIT == pytest.approx(1.3, abs=0.05)
    clip = [
        np.abs(received(*tones(40.0, 1e6 * ONE_DB_W), replace(QUIET, saturation=each)).power[:, 2700:2900])
        for each in (1.25, 1.5)  # the third harmonic of 40 m lies at 120 m
    ]
    assert clip[1].max() > 1e3 * clip[0].max()


@pytest.mark.parametrize(("above_db", "expected"), [(-0.2, False), (0.2, True)])
def test_azimuths_are_saturated_from_the_compression_point_on(above_db: float, expected: bool) -> None:
    echoes = tones(40.0, ONE_DB_W * 10 ** (above_db / 10))
    found = received(*echoes, replace(QUIET, saturation=1.0)).saturated
    assert found.tolist() == [expected] * SENSOR.azimuths
    assert not received(*echoes, QUIET).saturated.any()
