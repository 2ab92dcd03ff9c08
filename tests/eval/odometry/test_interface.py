"""What methods return: matched points of one number, motions that are finite or not."""

import math

import numpy as np
import pytest

from echoscape.eval.odometry.interface import MatchedPoints, PairMotion


def test_matches_have_points_for_every_weight() -> None:
    with pytest.raises(ValueError, match=r"points must be \(N, 2\) twice"):
        MatchedPoints(earlier_m=np.zeros((3, 2)), later_m=np.zeros((2, 2)), weights=np.zeros(3))
    assert not PairMotion(x_m=0.0, y_m=math.inf, yaw_rad=0.0).is_finite
