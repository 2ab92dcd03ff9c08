"""The intelligent driver model (Treiber, Hennecke & Helbing 2000)."""

import numpy as np
from numpy.testing import assert_allclose

from echoscape.scenes.traffic.car_following import idm_acceleration


def test_idm_acceleration_vanishes_at_the_desired_gap_and_brakes_as_the_gap_closes() -> None:
    speed = np.full(3, 10.0)
    gap = np.array([2.5 + 10.0 * 1.4, 10.0, 5.0])
    acceleration = idm_acceleration(speed, gap, np.zeros(3))
    assert_allclose(acceleration[0], 0.0, atol=1e-12)
    assert acceleration[2] < acceleration[1] < 0
