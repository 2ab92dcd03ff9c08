"""Paths follow the lane centres and are smooth."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import KDTree

from echoscape.scenes.core.lane_graph import RoadGraph
from echoscape.scenes.driving.lane_path import slow_noise, smooth_path, smoothed_line
from echoscape.scenes.driving.route import plan_route


def _rng(seed: int) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.mark.parametrize("seed", range(3))
def test_path_stays_by_the_lane_centres_and_is_smooth(town_roads: RoadGraph, seed: int) -> None:
    route = plan_route(town_roads, length_m=2000, rng=_rng(seed))
    lanes = [town_roads.lanes[lane] for lane in route.lanes]
    path = smooth_path(
        lanes,
        from_m=route.start_m,
        step_m=0.25,
        sigma_m=1.0,
        wander_m=0.08,
        wander_length_m=12.0,
        rng=_rng(seed),
    )
    off, _ = KDTree(np.concatenate([lane.centre for lane in lanes])).query(path.xy)
    assert off.max() < 0.6  # 0.4 m of wander and corner cutting, and samples up to 1 m apart
    assert_allclose(np.hypot(*np.diff(path.xy, axis=0).T), 0.25, rtol=0.01)
    assert_allclose(np.diff(path.heading) / 0.25, (path.curvature[1:] + path.curvature[:-1]) / 2, atol=0.01)
    assert np.abs(np.diff(path.curvature)).max() < 0.06  # 1/m within 0.25 m


def test_smoothing_moves_a_bend_inwards_by_half_curvature_times_sigma_squared() -> None:
    angle = np.linspace(0, 3, 3001)
    circle = 20.0 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)  # 0.02 m a sample
    smooth = smoothed_line(circle, sigma=50.0)  # 1 m
    assert_allclose(np.hypot(*smooth[1000:2000].T), 20.0 - 1.0 / (2 * 20.0), atol=1e-3)


def test_smoothing_leaves_a_straight_line() -> None:
    line = np.stack([np.arange(200.0), 3 * np.arange(200.0)], axis=-1)
    assert_allclose(smoothed_line(line, sigma=7.0), line, atol=1e-9)


def test_slow_noise_has_unit_variance() -> None:
    noise = slow_noise(200_000, sigma=5.0, rng=_rng(0))
    # About 200000 / (2 sqrt(pi) 5) = 11000 independent samples: the variance is known to 1.3 %, 4 sigma here.
    assert_allclose(noise.var(), 1.0, atol=0.055)
