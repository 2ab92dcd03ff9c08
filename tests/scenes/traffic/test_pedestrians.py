"""Pedestrians keep to their footpath and their pace, and never meet."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial import KDTree

from echoscape.scenes.roads.ground_mesh import WALKING_OFFSET_M
from echoscape.scenes.traffic.pedestrians import PACE_MPS, pedestrian_track, walking_loops


def _footpath(closed: bool) -> np.ndarray:
    if not closed:
        return np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 20.0]])
    return np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 20.0], [0.0, 20.0], [0.0, 0.0]])


@pytest.mark.parametrize("closed", [False, True])
def test_pedestrians_stay_on_their_footpath_at_their_pace(*, closed: bool) -> None:
    line = np.concatenate([np.linspace(a, b, 400) for a, b in pairwise(_footpath(closed))])
    for loop in walking_loops(_footpath(closed)):
        track = pedestrian_track(loop, start_m=3.0, pace_mps=1.4, duration_s=200.0)
        time = np.linspace(0, 199, 3000)
        off, _ = KDTree(line).query(track.pose(time)[:, :2])
        assert off.max() < WALKING_OFFSET_M + 0.4  # sharp corners are rounded
        assert_allclose(np.hypot(*track.velocity(time)[:, :2].T), 1.4, atol=0.3)
        assert_allclose(track.pose(time)[:, 2], 0.12)


@settings(max_examples=10, deadline=None)
@given(pace=st.floats(*PACE_MPS), apart_m=st.floats(2.0, 40.0))
def test_pedestrians_on_one_footpath_never_meet(pace: float, apart_m: float) -> None:
    loop = walking_loops(_footpath(closed=False))[0]
    tracks = [
        pedestrian_track(loop, start_m=start, pace_mps=pace, duration_s=120.0) for start in (0.0, apart_m)
    ]
    time = np.linspace(0, 120, 2000)
    between = np.hypot(*(tracks[0].pose(time) - tracks[1].pose(time))[:, :2].T)
    assert between.min() > 2 * WALKING_OFFSET_M - 0.3
