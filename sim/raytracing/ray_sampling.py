"""The set of ray directions of a scan: stratified, drawn from the antenna pattern, the same for every scan.

Rays of a row are drawn from its two-way pattern. A hit serves every row whose beam it lies in, so the rays of
all rows are one sample of the union of their densities (Veach 1997, multiple-sample balance heuristic):
a return's weight in a row is that row's gain over the density of the union.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.kinematics.rolling_scan import AzimuthPoses
from echoscape.sim.raytracing.bounces import RayBatch
from echoscape.sim.raytracing.intersection import Hits
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.sensor import Sensor

RAYS_STAGE = 300
"""Number of the stage that draws the directions of rays; those of scenes/ are smaller."""

_BEAM_DEG = (-6.0, 4.0)
"""Elevations between which a ray looks for the first obstacle of its row."""


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


class PrimaryRays:
    """The directions of one sensor's rays, `rays` for each row; they stay the same from scan to scan."""

    def __init__(self, sensor: Sensor, antenna: Antenna, *, rays: int, seed: int) -> None:
        """Draw the directions; `rays` is a square number."""
        rng = np.random.default_rng(np.random.SeedSequence([seed, RAYS_STAGE]))
        chosen = draw_directions(antenna, rays=rays, rng=rng)
        elevation = chosen.elevation_rad + math.radians(sensor.mount_tilt_deg)
        self._azimuths, self._rays = sensor.azimuths, rays
        self._row = mi.UInt32(chosen.row)
        self._forward = mi.Float64(np.cos(elevation) * np.cos(chosen.azimuth_rad))
        self._aside = mi.Float64(np.cos(elevation) * np.sin(chosen.azimuth_rad))
        self._up = mi.Float64(np.sin(elevation))
        self._density = mi.Float(chosen.density.astype(np.float32))
        one_way = np.interp(chosen.elevation_rad, antenna.elevation_grid_rad, antenna.elevation_one_way)
        self._gain = mi.Float(one_way.astype(np.float32))
        # Each ray looks for obstacles on behalf of the two rows that point nearest to it.
        places = chosen.azimuth_rad * (sensor.azimuths / (2 * math.pi))
        self._sides = [np.asarray(side(places), np.int64) % sensor.azimuths for side in (np.floor, np.ceil)]
        low, high = map(math.radians, _BEAM_DEG)
        self._in_beam = (elevation > low) & (elevation < high)

    def rays(self, poses: AzimuthPoses) -> RayBatch:
        """Point the directions along each row's heading from each row's place."""
        row = self._row
        cosine = dr.gather(mi.Float64, mi.Float64(np.cos(poses.yaw)), row)
        sine = dr.gather(mi.Float64, mi.Float64(np.sin(poses.yaw)), row)
        # Azimuth is clockwise from ahead: aside points right of the heading.
        x = cosine * self._forward + sine * self._aside
        y = sine * self._forward - cosine * self._aside
        origin = mi.Point3d(dr.gather(mi.Vector3d, mi.Float64(poses.position.ravel()), row))
        direction = mi.Vector3d(x, y, self._up)
        return RayBatch(
            origin=origin,
            direction=direction,
            travelled=dr.zeros(mi.Float64, dr.width(row)),
            weight=dr.full(mi.Float, 1, dr.width(row)),
            row=row,
            number=dr.arange(mi.UInt32, dr.width(row)),
            density=self._density,
            gain=self._gain,
            drift=dr.zeros(mi.Float, dr.width(row)),
            moved=dr.zeros(mi.Bool, dr.width(row)),
            start=origin,
            heading=direction,
            only_targets=dr.full(mi.Bool, True, dr.width(row)),
        )

    def first_obstacle_m(self, hits: Hits, *, obstacle: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Return, by row (azimuths,), the distance of the nearest hit in the main beam that is one [m].

        hits: of all rays; obstacle (I,): which instances are obstacles; inf in rows that met none.
        """
        counted = self._in_beam & hits.active.numpy() & obstacle[hits.instance.numpy()]
        distance = hits.distance.numpy()[counted].astype(np.float32)
        first = np.full(self._azimuths, np.inf, np.float32)
        for rows in self._sides:
            np.minimum.at(first, rows[counted], distance)
        return first

    def clear_share(self, hits: Hits, edges_m: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the share of each row's two-way beam that reaches ranges (azimuths, len(edges_m)).

        hits: of all rays; edges_m: increasing [m]. Each ray stands for its gain over the density with which
        it was drawn.
        """
        distance_m = np.where(hits.active.numpy(), hits.distance.numpy(), np.inf)
        weight = np.square(self._gain.numpy().astype(np.float64)) / self._density.numpy()
        weight /= np.repeat(weight.reshape(self._azimuths, -1).sum(axis=1), self._rays)
        cell = self._row.numpy() * np.int64(len(edges_m) + 1) + np.searchsorted(edges_m, distance_m)
        ended = np.bincount(cell, weight, self._azimuths * (len(edges_m) + 1)).reshape(self._azimuths, -1)
        return np.clip(1 - np.cumsum(ended, axis=1)[:, :-1], 0, 1).astype(np.float32)
