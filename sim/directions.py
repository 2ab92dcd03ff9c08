"""The set of ray directions of a scan: stratified, drawn from the antenna pattern, the same for every scan.

Rays of a row are drawn from its two-way pattern. A hit serves every row whose beam it lies in, so the rays of
all rows are one sample of the union of their densities (Veach 1997, multiple-sample balance heuristic):
a return's weight in a row is that row's gain over the density of the union.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.antenna import Antenna

WIDE_SHARE = 0.25
"""Share of rays drawn in elevation from the one-way pattern, which is broader: it serves high facades and
returns that leave and come back by different directions."""
GROUND_SHARE = 0.3
"""Share of rays drawn so that they would meet level ground evenly by range: near ground has hundreds of range
cells in few degrees where the pattern is weak, and its speckle needs rays in each. The rest of the rays
follow the two-way pattern."""
GROUND_M = (4.0, 50.0)
"""Ranges over which those rays meet level ground [m]."""


@dataclass(frozen=True, kw_only=True)
class Directions:
    """Rays of a whole turn, in the frame of the antenna's axis: rows x rays, flattened row by row.

    row (N,) uint32; azimuth_rad (N,) float64, absolute within the turn; elevation_rad (N,) float64;
    density (N,) float64, rays a steradian of the union over all rows.
    """

    row: NDArray[np.uint32]
    azimuth_rad: NDArray[np.float64]
    elevation_rad: NDArray[np.float64]
    density: NDArray[np.float64]


def _cumulative(weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distribution function of a piecewise-linear density on an even grid, from 0 to 1."""
    steps = (weight[1:] + weight[:-1]) / 2
    total = np.append(0.0, np.cumsum(steps))
    return total / total[-1]


def _elevation_density(antenna: Antenna) -> NDArray[np.float64]:
    """Return the density of rays by elevation [1/rad] on the antenna's elevation grid, integral 1."""
    solid = np.cos(antenna.elevation_grid_rad)
    two_way, one_way = antenna.elevation_one_way**2 * solid, antenna.elevation_one_way * solid
    step = antenna.elevation_grid_rad[1] - antenna.elevation_grid_rad[0]
    ground = _evenly_over_ground(antenna)
    if not ground.any():  # a beam that looks up, or an antenna that stands in the road, meets none
        ground = two_way
    shares = ((1 - WIDE_SHARE - GROUND_SHARE, two_way), (WIDE_SHARE, one_way), (GROUND_SHARE, ground))
    return np.sum([share * weight / weight.sum() for share, weight in shares], axis=0) / step


def _evenly_over_ground(antenna: Antenna) -> NDArray[np.float64]:
    """Return the density by elevation, but for a factor, of rays that meet level ground evenly by range.

    Ground at the angle a below the horizon lies at h / tan a, so that dr / da = h / sin^2 a.
    """
    sensor = antenna.sensor
    below = -(antenna.elevation_grid_rad + math.radians(sensor.mount_tilt_deg))
    near, far = (math.atan(sensor.mount_height_m / range_m) for range_m in GROUND_M)
    within = (below >= far) & (below <= near)
    return np.divide(1.0, np.sin(below) ** 2, out=np.zeros_like(below), where=within)


_OVERLAP_ROWS = 60
"""Rows whose beam lies farther from a ray than this have no part in its density to speak of."""


def _union_azimuth_density(
    antenna: Antenna, rays: int, row: NDArray[np.uint32], offset: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return rays a radian of the union over rows, at `offset` (N,) [rad] from the middle of `row` (N,).

    The first and the last row do not meet: a turn lies between them, and the car has moved on.
    """
    grid, azimuths = antenna.azimuth_grid_rad, antenna.sensor.azimuths
    one_row = antenna.azimuth_two_way / np.trapezoid(antenna.azimuth_two_way, grid)
    spacing = 2 * math.pi / azimuths
    total = np.zeros(len(row))
    nearest = row.astype(np.int64) + np.rint(offset / spacing).astype(np.int64)
    aside = offset - (nearest - row) * spacing
    for step in range(-_OVERLAP_ROWS, _OVERLAP_ROWS + 1):
        there = (nearest + step >= 0) & (nearest + step < azimuths)
        total += there * np.interp(aside - step * spacing, grid, one_row)
    # A ray of a far sidelobe that points across the seam has its own row's density alone.
    alone = np.abs(nearest - row) > _OVERLAP_ROWS
    total[alone] += np.interp(offset[alone], grid, one_row)
    return rays * total


def draw_directions(antenna: Antenna, *, rays: int, rng: np.random.Generator) -> Directions:
    """Draw `rays` directions for every row, stratified in azimuth and elevation.

    Raises:
        ValueError: `rays` is not a square number of 16 or more.
    """
    side = math.isqrt(max(rays, 0))
    if side * side != rays or side < 4:
        raise ValueError(f"rays must be a square number of 16 or more, got {rays}")
    azimuths = antenna.sensor.azimuths
    row = np.repeat(np.arange(azimuths, dtype=np.uint32), rays)
    # Sudoku-like (multi-jittered) strata: even in each angle alone and in both together.
    i, j = np.divmod(np.tile(np.arange(rays), azimuths), side)
    u = (i + (_shuffled(azimuths, side, rng=rng)[row, j] + rng.random(row.size)) / side) / side
    v = (j + (_shuffled(azimuths, side, rng=rng)[row, i] + rng.random(row.size)) / side) / side
    offset = np.interp(u, _cumulative(antenna.azimuth_two_way), antenna.azimuth_grid_rad)
    elevation_density = _elevation_density(antenna)
    elevation = np.interp(v, _cumulative(elevation_density), antenna.elevation_grid_rad)
    union = _union_azimuth_density(antenna, rays, row, offset)
    by_elevation = np.interp(elevation, antenna.elevation_grid_rad, elevation_density)
    return Directions(
        row=row,
        azimuth_rad=(row * (2 * math.pi / azimuths) + offset) % (2 * math.pi),
        elevation_rad=elevation,
        density=union * by_elevation / np.cos(elevation),
    )


def _shuffled(rows: int, side: int, *, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return (rows, side) independent permutations of 0..side-1."""
    return np.argsort(rng.random((rows, side)), axis=1)
