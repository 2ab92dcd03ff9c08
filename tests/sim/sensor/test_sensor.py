import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from echoscape.sim.sensor.cts350x import CTS350X
from echoscape.sim.sensor.registry import SENSORS
from echoscape.sim.sensor.sensor import Sensor


def test_derived_quantities_follow_from_each_other() -> None:
    # beta = f0 T / B; a bin is c fs T / (2 B N); the resolution is c / 2B.
    assert CTS350X.sweep_s == pytest.approx(0.049 * 636e6 / 76.5e9)
    bin_m = 299792458 * CTS350X.sample_hz * CTS350X.sweep_s / (2 * CTS350X.bandwidth_hz * CTS350X.fft_size)
    assert bin_m == pytest.approx(0.0432)
    assert CTS350X.resolution_m == pytest.approx(0.2357, abs=1e-4)
    assert CTS350X.sweep_s < CTS350X.azimuth_period_s
    assert CTS350X.range_m == pytest.approx(162.8, abs=0.1)
    assert CTS350X.wavelength_m == pytest.approx(3.919e-3, abs=1e-6)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("bandwidth_hz", math.nan),
        ("bandwidth_hz", -1.0),
        ("bandwidth_hz", 1e15),
        ("antenna_gain_db", 35.9),  # the patterns integrate to 35.15
        ("tx_power_w", math.inf),
        ("fft_size", 6000),
        ("chirps", "sideways"),
        ("window", "square"),
        ("azimuths", 0),
        ("epoch_us", 1_700_000_000),  # seconds
        ("epoch_us", 1_700_000_000_000_000_000),  # nanoseconds
        ("leakage_dbm", ((1.0, -90.0),)),
        ("range_gain_db", ((1.0, 0.0), (0.5, 0.0))),
        ("range_gain_db", ((1.0, 0.0), (2.0, math.nan))),
    ],
)
def test_refuses_what_makes_no_radar_and_names_it(field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=field):
        replace(CTS350X, **{field: value})


@pytest.mark.parametrize(("name", "first"), [("cts350x", 13), ("cir204", 7), ("cir304", 7), ("cir304_rt", 7)])
def test_real_radars_count_14_of_5600_from_azimuth_to_azimuth_and_look_there(name: str, first: int) -> None:
    sensor = SENSORS[name]
    assert_array_equal(sensor.encoder, first + 14 * np.arange(400))
    assert_allclose(np.degrees(sensor.azimuth_rad), 360 / 5600 * (first + 14 * np.arange(400)), atol=1e-9)


@given(st.data())
def test_encoder_counts_lie_less_than_one_below_their_directions(data: st.DataObject) -> None:
    azimuths = data.draw(st.integers(1, 1000))
    per_turn = data.draw(st.integers(azimuths, 65_536))
    first = data.draw(st.integers(0, per_turn - 1))
    sensor: Sensor = replace(CTS350X, azimuths=azimuths, encoder_per_turn=per_turn, encoder_first=first)
    counts = sensor.azimuth_rad / (2 * math.pi) * per_turn
    below = np.remainder(counts - sensor.encoder + 1e-6, per_turn)
    assert (below < 1 + 2e-6).all()
    assert sensor.encoder[0] == first
    assert len(np.unique(sensor.encoder)) == azimuths


def test_objects_on_the_vehicle_block_azimuths_by_their_direction() -> None:
    # A mast from 45 to 46 deg: azimuth 50 looks along (13 + 50 x 14) / 5600 of a revolution, 45.84 deg.
    mast = ((0.0, 0.0), (44.99, 0.0), (45.0, 20.0), (46.0, 20.0), (46.01, 0.0), (360.0, 0.0))
    assert np.flatnonzero(replace(CTS350X, blocking_db=mast).azimuth_loss_db).tolist() == [50]
    ahead = replace(CTS350X, blocking_db=mast, encoder_first=0)  # 45.0 and 45.9 deg
    assert np.flatnonzero(ahead.azimuth_loss_db).tolist() == [50, 51]
