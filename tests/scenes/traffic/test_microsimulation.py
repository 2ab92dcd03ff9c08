"""Simulated vehicles follow the vehicle ahead at a distance."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.driving.ego_drive import plan_ego_drive
from echoscape.scenes.traffic.microsimulation import Fleet, simulate_traffic


def test_followers_keep_their_distance(straight: RoadGraph) -> None:
    slow_lead = Fleet(
        lane=np.array([0, 0, 0]),
        station_m=np.array([60.0, 40.0, 20.0]),
        length_m=np.full(3, 4.5),
        max_speed_mps=np.array([4.0, 13.0, 13.0]),
        speed_factor=np.ones(3),
        lane_weight=np.ones(len(straight.lanes)),
        may_use=np.ones((3, len(straight.lanes)), dtype=bool),
    )
    drive = plan_ego_drive(straight, seed=3, duration_s=40)
    far = replace(drive, travel_m=np.full_like(drive.travel_m, 0.0))  # the radar car stays far from others
    record = simulate_traffic(straight, far, slow_lead, step_s=0.2, rng=np.random.default_rng(0))
    gap = -np.diff(record.travel_m, axis=1) - 4.5
    assert gap.min() > 1.5
    # In the end all go at the speed of the first, at s0 + v T = 2.5 + 4 x 1.4 m, a little more for v / v0.
    assert_allclose(record.speed_mps[-40], 4.0, atol=0.3)
    assert_allclose(gap[-40], 8.1, atol=1.5)
