"""Ray directions are a digital net in each azimuth, with the density that they are weighted by."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from echoscape.sim.raytracing.ray_sampling import (
    MARGIN_AZIMUTHS,
    RAYS_STAGE,
    Directions,
    PrimaryRays,
    draw_directions,
)
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.cts350x import CTS350X

RAYS = 256
STEP_RAD = 2 * math.pi / CTS350X.azimuths


@pytest.fixture(scope="module")
def antenna() -> Antenna:
    return Antenna(replace(CTS350X, encoder_first=0))  # the first azimuth looks straight ahead


@pytest.fixture(scope="module")
def directions(antenna: Antenna) -> Directions:
    return draw_directions(antenna, rays=RAYS, rng=np.random.default_rng(5))


def places(antenna: Antenna, drawn: Directions, rays: int) -> tuple[NDArray, NDArray]:
    """Where rays lie (A, rays) across their azimuth and in the share of rays below them, each 0 to 1."""
    rows = len(drawn.azimuth_rad) // rays
    position = np.repeat(np.arange(rows) - (rows - CTS350X.azimuths) // 2, rays)
    across = (drawn.azimuth_rad / STEP_RAD - position + 0.5) % CTS350X.azimuths
    # The density over elevation, cos(e) x density, integrates to the number of rays of an azimuth.
    grid = antenna.elevation_grid_rad
    order = np.argsort(drawn.elevation_rad)
    known = np.interp(
        grid, drawn.elevation_rad[order], (drawn.density * np.cos(drawn.elevation_rad))[order], 0, 0
    )
    below = np.cumsum((known[1:] + known[:-1]) / 2 * np.diff(grid))
    share = np.interp(drawn.elevation_rad, grid[1:], below / below[-1])
    return across.reshape(rows, rays), share.reshape(rows, rays)


@pytest.mark.parametrize("rays", [16, 64, 256, 512])
def test_every_elementary_box_of_an_azimuth_holds_one_ray(antenna: Antenna, rays: int) -> None:
    # A (0, m, 2)-net in base 2 (Niederreiter 1992): 2^m points, one in each box of 2^-k x 2^(k - m).
    drawn = draw_directions(antenna, rays=rays, rng=np.random.default_rng(1))
    across, _ = places(antenna, drawn, rays)
    up = np.argsort(np.argsort(drawn.elevation_rad.reshape(across.shape), axis=1), axis=1)
    assert across.min() >= 0
    assert across.max() < 1
    columns = 1
    while columns <= rays:
        layers = rays // columns
        box = (across * columns).astype(int) * layers + up // columns
        assert (np.sort(box, axis=1) == np.arange(rays)).all(), f"{columns} x {layers} boxes"
        columns *= 2


def test_layers_of_elevation_hold_equal_shares_of_the_density(antenna: Antenna) -> None:
    # Not only the order: the k-th ray from below lies in the k-th of `rays` layers of equal probability.
    _, share = places(antenna, draw_directions(antenna, rays=512, rng=np.random.default_rng(2)), 512)
    layer = np.sort(share, axis=1) * 512 - np.arange(512)
    assert np.abs(layer - 0.5).max() < 0.75  # the density is integrated over its own rays here


def test_directions_go_on_across_the_seam(directions: Directions) -> None:
    rows = CTS350X.azimuths + 2 * MARGIN_AZIMUTHS
    azimuth = directions.azimuth.reshape(rows, RAYS)
    assert MARGIN_AZIMUTHS == 4  # as far as a main lobe reaches beyond its own azimuth
    assert (azimuth[:5] == 0).all()
    assert (azimuth[-5:] == CTS350X.azimuths - 1).all()
    assert (azimuth[4:-4] == np.arange(CTS350X.azimuths)[:, None]).all()
    before, after = (directions.azimuth_rad.reshape(rows, RAYS)[row] / STEP_RAD for row in (0, -1))
    assert np.abs(before - (CTS350X.azimuths - 4)).max() <= 0.5
    assert np.abs(after - 3).max() <= 0.5


def own_side(directions: Directions) -> NDArray[np.bool_]:
    """Rays but for those of the margins, which look where others look as well."""
    number = np.arange(len(directions.azimuth)) // RAYS
    return (number >= MARGIN_AZIMUTHS) & (number < MARGIN_AZIMUTHS + CTS350X.azimuths)


@pytest.mark.parametrize("row", [0, 1, 137, 399])
def test_rays_weighted_by_their_density_hold_the_patterns_energy(
    antenna: Antenna, directions: Directions, row: int
) -> None:
    mine = own_side(directions)
    offset = directions.azimuth_rad - row * STEP_RAD
    offset = (offset + math.pi) % (2 * math.pi) - math.pi
    gain = antenna.two_way_gain(offset, directions.elevation_rad) / antenna.peak_gain**2
    energy_sr = np.sum((gain / directions.density)[mine])
    assert energy_sr == pytest.approx(antenna.two_way_energy_sr, rel=0.003)


@pytest.mark.parametrize("row", [0, 399])
def test_margins_hold_the_energy_of_a_main_lobe_across_the_seam(
    antenna: Antenna, directions: Directions, row: int
) -> None:
    # By its own rays and margins alone, an azimuth at the seam has its whole main lobe, 3 azimuths wide.
    position = np.arange(len(directions.azimuth)) // RAYS - MARGIN_AZIMUTHS
    offset = (directions.azimuth_rad - row * STEP_RAD + math.pi) % (2 * math.pi) - math.pi
    near = np.abs(position - row) <= MARGIN_AZIMUTHS
    gain = antenna.two_way_gain(offset, directions.elevation_rad) / antenna.peak_gain**2
    energy_sr = np.sum((gain / directions.density)[near])
    assert energy_sr == pytest.approx(antenna.two_way_energy_sr, rel=0.01)


@pytest.mark.parametrize(("low_deg", "high_deg"), [(-0.5, 0.5), (-12.0, -6.0), (2.0, 10.0)])
def test_density_counts_the_rays_of_a_solid_angle(
    directions: Directions, low_deg: float, high_deg: float
) -> None:
    # Every ray stands for 1 / density [sr]: over a box of 90 deg in azimuth they add up to its solid angle.
    elevation = np.degrees(directions.elevation_rad)
    inside = (elevation >= low_deg) & (elevation < high_deg) & own_side(directions)
    inside &= np.abs(directions.azimuth_rad - math.pi / 2) < math.pi / 4
    solid = math.pi / 2 * (math.sin(math.radians(high_deg)) - math.sin(math.radians(low_deg)))
    assert np.sum(1 / directions.density[inside]) == pytest.approx(solid, rel=0.02)


def test_most_rays_look_where_40_to_160_m_are_and_some_look_down(directions: Directions) -> None:
    # From a mast 1.97 m high the ground at 40 m lies 2.8 deg below the horizon; roofs reach above it.
    elevation = np.degrees(directions.elevation_rad)
    assert np.mean(np.abs(elevation) < 3) > 0.5
    assert np.sum(elevation < -20) > np.sum(elevation > 20)


def test_no_ray_outweighs_the_others(antenna: Antenna, directions: Directions) -> None:
    # A ray's weight is the gain towards it over its density, which follows the gain.
    weight = (
        antenna.two_way_gain(np.zeros(len(directions.density)), directions.elevation_rad) / directions.density
    )
    assert weight.max() < 2 * np.median(weight)


def test_directions_are_the_own_of_seed_and_draw(antenna: Antenna, directions: Directions) -> None:
    again = draw_directions(antenna, rays=RAYS, rng=np.random.default_rng(5))
    other = draw_directions(antenna, rays=RAYS, rng=np.random.default_rng(6))
    assert np.array_equal(again.azimuth_rad, directions.azimuth_rad)
    assert not np.array_equal(other.azimuth_rad, directions.azimuth_rad)


def test_a_beam_that_meets_no_ground_has_directions() -> None:
    drawn = draw_directions(
        Antenna(replace(CTS350X, mount_tilt_deg=60.0)), rays=64, rng=np.random.default_rng(0)
    )
    assert np.isfinite(drawn.density).all()
    assert (drawn.density > 0).all()


@pytest.mark.parametrize("rays", [0, 8, 9, 200, 225, -16])
def test_refuses_ray_counts_that_are_no_net(antenna: Antenna, rays: int) -> None:
    with pytest.raises(ValueError, match=f"rays must be a power of two from 16, got {rays}"):
        draw_directions(antenna, rays=rays, rng=np.random.default_rng(0))


def test_rays_of_a_sensor_are_those_of_seed_stage_and_draw(antenna: Antenna) -> None:
    sensor = antenna.sensor
    rays = [PrimaryRays(sensor, antenna, rays=16, seed=7, draw=draw)._forward.numpy() for draw in (0, 0, 1)]
    assert np.array_equal(rays[0], rays[1])
    assert np.mean(rays[0] == rays[2]) < 0.01
    rng = np.random.default_rng(np.random.SeedSequence([7, RAYS_STAGE, 1]))
    drawn = draw_directions(antenna, rays=16, rng=rng)
    forward = np.cos(drawn.elevation_rad) * np.cos(drawn.azimuth_rad)
    np.testing.assert_allclose(rays[2], forward, atol=1e-12)
