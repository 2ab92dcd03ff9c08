"""Ray directions follow the antenna pattern, with the density that they are weighted by."""

import math
from dataclasses import replace

import numpy as np
import pytest

from echoscape.sim.raytracing.ray_sampling import Directions, draw_directions
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.cts350x import CTS350X


@pytest.fixture(scope="module")
def antenna() -> Antenna:
    return Antenna(replace(CTS350X, encoder_first=0))  # the first azimuth looks straight ahead


@pytest.fixture(scope="module")
def directions(antenna: Antenna) -> Directions:
    return draw_directions(antenna, rays=256, rng=np.random.default_rng(5))


def test_rays_weighted_by_their_density_hold_the_patterns_energy(
    antenna: Antenna, directions: Directions
) -> None:
    for row in (0, 137, 399):
        near = np.abs(directions.azimuth.astype(int) - row) < 100  # not across the seam of first and last row
        offset = directions.azimuth_rad - row * 2 * math.pi / CTS350X.azimuths
        gain = antenna.two_way_gain(offset, directions.elevation_rad) / antenna.peak_gain**2
        # Stratified: the error is well below the 3 % that as many independent rays would have.
        assert np.sum((gain / directions.density)[near]) == pytest.approx(antenna.two_way_energy_sr, rel=0.03)


def test_density_counts_the_rays_of_a_solid_angle(directions: Directions) -> None:
    # Rays a steradian over a box of 90 deg x 1 deg about the horizon: every ray stands for 1 / density.
    inside = (np.abs(directions.elevation_rad) < math.radians(0.5)) & (
        np.abs(directions.azimuth_rad - math.pi / 2) < math.pi / 4
    )
    solid = math.pi / 2 * 2 * math.sin(math.radians(0.5))
    assert np.sum(1 / directions.density[inside]) == pytest.approx(solid, rel=0.02)


def test_rays_follow_the_pattern_and_reach_its_sidelobes(directions: Directions) -> None:
    offset = directions.azimuth_rad - directions.azimuth * 2 * math.pi / CTS350X.azimuths
    offset = np.degrees(np.abs((offset + math.pi) % (2 * math.pi) - math.pi))
    assert np.mean(offset < 0.6) == pytest.approx(0.77, abs=0.08)  # the -3 dB width holds some three quarters
    assert np.sum(offset > 3.0) > 0
    assert np.sum(directions.elevation_rad < -math.radians(20)) > np.sum(
        directions.elevation_rad > math.radians(20)
    )


def test_directions_are_the_seeds_own(antenna: Antenna, directions: Directions) -> None:
    again = draw_directions(antenna, rays=256, rng=np.random.default_rng(5))
    other = draw_directions(antenna, rays=256, rng=np.random.default_rng(6))
    assert np.array_equal(again.azimuth_rad, directions.azimuth_rad)
    assert not np.array_equal(other.azimuth_rad, directions.azimuth_rad)


def test_rays_that_point_far_across_the_seam_have_a_density(antenna: Antenna) -> None:
    # Of these, one leaves row 50 by 74 deg to the left, where no row within the scan points.
    rng = np.random.default_rng(np.random.SeedSequence([45, 300]))
    drawn = draw_directions(antenna, rays=1024, rng=rng)
    offset = np.degrees(drawn.azimuth_rad - drawn.azimuth * 2 * math.pi / CTS350X.azimuths)
    assert ((np.abs((offset + 180) % 360 - 180) > 60) & (np.abs(offset) > 180)).any()
    assert (drawn.density > 0).all()


@pytest.mark.parametrize("rays", [0, 9, 200])
def test_refuses_ray_counts_without_strata(antenna: Antenna, rays: int) -> None:
    with pytest.raises(ValueError, match="rays must be a square number"):
        draw_directions(antenna, rays=rays, rng=np.random.default_rng(0))


def test_no_ray_outweighs_the_others_within_the_turn(antenna: Antenna, directions: Directions) -> None:
    # Away from the seam a ray's weight is the beam's peak over a density that is nearly even in azimuth.
    spacing = 2 * math.pi / CTS350X.azimuths
    offset = directions.azimuth_rad - directions.azimuth * spacing
    offset = (offset + math.pi) % (2 * math.pi) - math.pi
    points_at = directions.azimuth + offset / spacing
    inner = (points_at > 10) & (points_at < 389)
    gain = antenna.two_way_gain(np.zeros(inner.sum()), directions.elevation_rad[inner])
    weight = gain / directions.density[inner]
    assert inner.mean() > 0.9
    assert weight.max() < 4 * np.median(weight)


@pytest.mark.parametrize(("azimuth_deg", "elevation_deg"), [(0.1, 0.1), (0.2, 0.2), (0.4, 0.2), (0.5, 0.5)])
def test_counts_in_small_cells_vary_as_the_speckle_takes_them_to(
    directions: Directions, azimuth_deg: float, elevation_deg: float
) -> None:
    edges = [np.arange(5, 355, azimuth_deg), np.arange(-1, 1, elevation_deg)]
    angles = np.degrees(directions.azimuth_rad), np.degrees(directions.elevation_rad)
    counts, _, _ = np.histogram2d(*angles, bins=edges)
    mean = counts.mean()
    variance = np.mean((counts - counts.mean(axis=0)) ** 2)
    assert mean + variance / mean == pytest.approx(mean + 1 / (1 + mean / 2), rel=0.05)
