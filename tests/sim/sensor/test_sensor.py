import math
from dataclasses import replace
from typing import Any

import pytest

from echoscape.sim.sensor.cts350x import CTS350X


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
        ("leakage_dbm", ((1.0, -90.0),)),
        ("range_gain_db", ((1.0, 0.0), (0.5, 0.0))),
        ("range_gain_db", ((1.0, 0.0), (2.0, math.nan))),
    ],
)
def test_refuses_what_makes_no_radar_and_names_it(field: str, value: Any) -> None:
    with pytest.raises(ValueError, match=field):
        replace(CTS350X, **{field: value})
