"""The antenna's gain: shape of the elevation lobe, periodicity in azimuth."""

import math

import numpy as np
import pytest

from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.cts350x import CTS350X


@pytest.fixture(scope="module")
def antenna() -> Antenna:
    return Antenna(CTS350X)


def test_elevation_lobe_is_filled_below_and_steep_above(antenna: Antenna) -> None:
    gain = antenna.two_way_gain(np.zeros(4), np.radians([-10.0, 10.0, -25.0, 25.0]))
    assert gain[0] > 10 * gain[1]
    assert gain[2] > gain[3]


def test_gain_repeats_after_a_revolution(antenna: Antenna) -> None:
    azimuth = np.linspace(-3, 3, 50)
    np.testing.assert_allclose(
        antenna.two_way_gain(azimuth + 2 * math.pi, np.zeros(50)),
        antenna.two_way_gain(azimuth, np.zeros(50)),
        rtol=1e-9,
    )
