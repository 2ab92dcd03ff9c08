"""Directions of the primary rays: stratified, drawn from the antenna pattern, the same in every scan.

The rays of an azimuth are drawn from its two-way pattern. A hit serves every azimuth whose beam covers it, so
the rays of all azimuths are one sample of the sum of their densities (Veach 1997, multiple-sample balance
heuristic): the weight of a return in an azimuth is the gain of that azimuth over the summed density.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.raytracing.bounces import RayBatch
from echoscape.sim.raytracing.intersection import Hits
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.scan_state import PoseTables
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.sensor import Sensor

RAYS_STAGE = 300
"""Number of the random stage of ray directions; those of scenes/ are smaller."""
_BEAM_DEG = (-6.0, 4.0)
"""Elevations between which a hit counts as the first obstacle of an azimuth."""
WIDE_SHARE = 0.25
"""Share of rays drawn in elevation from the one-way pattern, which is broader: for high facades, and for
paths that leave and return in different directions."""
GROUND_SHARE = 0.3
"""Share of rays drawn so that they would meet level ground evenly in range: near ground spreads over hundreds
of range bins within a few degrees where the pattern is weak, and its speckle needs rays in each. The other
rays follow the two-way pattern."""
GROUND_M = (4.0, 50.0)
"""Ranges over which those rays meet level ground [m]."""


@dataclass(frozen=True, kw_only=True)
class Directions:
    """N directions for a whole revolution, in the frame of the antenna axis, one azimuth after the other.

    Attributes:
        azimuth: Number of the azimuth that each ray is drawn for (N,) uint32.
        azimuth_rad: Angle from straight ahead, clockwise (N,) float64 [rad].
        elevation_rad: Elevation (N,) float64 [rad].
        density: Rays per solid angle, summed over all azimuths (N,) float64 [1/sr].
    """

    azimuth: NDArray[np.uint32]
    azimuth_rad: NDArray[np.float64]
    elevation_rad: NDArray[np.float64]
    density: NDArray[np.float64]


def _cumulative(weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cumulative distribution of a piecewise-linear density on an even grid, from 0 to 1."""
    steps = (weight[1:] + weight[:-1]) / 2
    total = np.append(0.0, np.cumsum(steps))
    return total / total[-1]


def _elevation_density(antenna: Antenna) -> NDArray[np.float64]:
    """Return the density of rays over elevation on the antenna's grid, integral 1 [1/rad]."""
    solid = np.cos(antenna.elevation_grid_rad)
    two_way, one_way = antenna.elevation_one_way**2 * solid, antenna.elevation_one_way * solid
    step = antenna.elevation_grid_rad[1] - antenna.elevation_grid_rad[0]
    ground = _evenly_over_ground(antenna)
    if not ground.any():  # an upward beam, or an antenna below the road, meets no ground
        ground = two_way
    shares = ((1 - WIDE_SHARE - GROUND_SHARE, two_way), (WIDE_SHARE, one_way), (GROUND_SHARE, ground))
    return np.sum([share * weight / weight.sum() for share, weight in shares], axis=0) / step


def _evenly_over_ground(antenna: Antenna) -> NDArray[np.float64]:
    """Return the unnormalised density over elevation of rays that meet level ground evenly in range.

    Ground at the angle a below the horizon lies at h / tan a, so that dr / da = h / sin^2 a.
    """
    sensor = antenna.sensor
    below = -(antenna.elevation_grid_rad + math.radians(sensor.mount_tilt_deg))
    near, far = (math.atan(sensor.mount_height_m / range_m) for range_m in GROUND_M)
    within = (below >= far) & (below <= near)
    return np.divide(1.0, np.sin(below) ** 2, out=np.zeros_like(below), where=within)


_OVERLAP_AZIMUTHS = 60
"""Azimuths whose beam lies farther from a ray than this add nothing of note to its density."""


def _azimuth_density(
    antenna: Antenna, rays: int, azimuth: NDArray[np.uint32], offset: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return rays per radian of all azimuths together, at `offset` (N,) [rad] from `azimuth` (N,).

    The first and the last azimuth do not overlap: a revolution lies between them, and the car has moved on.
    """
    grid, azimuths = antenna.azimuth_grid_rad, antenna.sensor.azimuths
    single = antenna.azimuth_two_way / np.trapezoid(antenna.azimuth_two_way, grid)
    spacing = 2 * math.pi / azimuths
    total = np.zeros(len(azimuth))
    nearest = azimuth.astype(np.int64) + np.rint(offset / spacing).astype(np.int64)
    aside = offset - (nearest - azimuth) * spacing
    for step in range(-_OVERLAP_AZIMUTHS, _OVERLAP_AZIMUTHS + 1):
        there = (nearest + step >= 0) & (nearest + step < azimuths)
        total += there * np.interp(aside - step * spacing, grid, single)
    # A ray of a far sidelobe that points across the seam has the density of its own azimuth alone.
    alone = np.abs(nearest - azimuth) > _OVERLAP_AZIMUTHS
    total[alone] += np.interp(offset[alone], grid, single)
    return rays * total


def draw_directions(antenna: Antenna, *, rays: int, rng: np.random.Generator) -> Directions:
    """Draw directions for every azimuth, stratified in azimuth and elevation.

    Args:
        antenna: The antenna patterns.
        rays: Number of rays per azimuth, a square number of 16 or more.
        rng: Draws the directions.

    Returns:
        Directions (azimuths x rays).

    Raises:
        ValueError: `rays` is not a square number of 16 or more.
    """
    side = math.isqrt(max(rays, 0))
    if side * side != rays or side < 4:
        raise ValueError(f"rays must be a square number of 16 or more, got {rays}")
    azimuths = antenna.sensor.azimuths
    azimuth = np.repeat(np.arange(azimuths, dtype=np.uint32), rays)
    # Multi-jittered strata: even in each angle alone and in both together.
    i, j = np.divmod(np.tile(np.arange(rays), azimuths), side)
    u = (i + (_shuffled(azimuths, side, rng=rng)[azimuth, j] + rng.random(azimuth.size)) / side) / side
    v = (j + (_shuffled(azimuths, side, rng=rng)[azimuth, i] + rng.random(azimuth.size)) / side) / side
    offset = np.interp(u, _cumulative(antenna.azimuth_two_way), antenna.azimuth_grid_rad)
    elevation_density = _elevation_density(antenna)
    elevation = np.interp(v, _cumulative(elevation_density), antenna.elevation_grid_rad)
    in_azimuth = _azimuth_density(antenna, rays, azimuth, offset)
    in_elevation = np.interp(elevation, antenna.elevation_grid_rad, elevation_density)
    return Directions(
        azimuth=azimuth,
        azimuth_rad=(antenna.sensor.azimuth_rad[azimuth] + offset) % (2 * math.pi),
        elevation_rad=elevation,
        density=in_azimuth * in_elevation / np.cos(elevation),
    )


def _shuffled(count: int, side: int, *, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return `count` independent permutations of 0..side-1 (count, side)."""
    return np.argsort(rng.random((count, side)), axis=1)


@dataclass(frozen=True, kw_only=True)
class PrimaryHits:
    """What the primary rays of one scan meet.

    Attributes:
        rays: All primary rays.
        hits: What each of them meets first.
    """

    rays: RayBatch
    hits: Hits


class PrimaryRays:
    """The directions of the primary rays of a sensor, which are the same in every scan."""

    def __init__(self, sensor: Sensor, antenna: Antenna, *, rays: int, seed: int) -> None:
        """Draw the directions.

        Args:
            sensor: The radar.
            antenna: Its patterns.
            rays: Number of rays per azimuth, a square number.
            seed: Decides the directions.
        """
        rng = np.random.default_rng(np.random.SeedSequence([seed, RAYS_STAGE]))
        drawn = draw_directions(antenna, rays=rays, rng=rng)
        elevation = drawn.elevation_rad + math.radians(sensor.mount_tilt_deg)
        self._azimuths, self._rays = sensor.azimuths, rays
        self._azimuth = mi.UInt32(drawn.azimuth)
        self._forward = mi.Float64(np.cos(elevation) * np.cos(drawn.azimuth_rad))
        self._right = mi.Float64(np.cos(elevation) * np.sin(drawn.azimuth_rad))
        self._up = mi.Float64(np.sin(elevation))
        self._density = mi.Float(drawn.density.astype(np.float32))
        one_way = np.interp(drawn.elevation_rad, antenna.elevation_grid_rad, antenna.elevation_one_way)
        self._gain = mi.Float(one_way.astype(np.float32))
        # Each ray looks for obstacles in the two azimuths that point nearest to it.
        position = (drawn.azimuth_rad - sensor.first_azimuth_rad) / sensor.azimuth_step_rad
        self._sides = [np.asarray(side(position), np.int64) % sensor.azimuths for side in (np.floor, np.ceil)]
        low, high = map(math.radians, _BEAM_DEG)
        self._in_beam = (elevation > low) & (elevation < high)

    def rays(self, poses: PoseTables) -> RayBatch:
        """Send the rays from the antenna positions of a scan, in the frame of the tilted antenna.

        Args:
            poses: The antenna in the scan.

        Returns:
            All primary rays (azimuths x rays).
        """
        azimuth = self._azimuth
        origin = mi.Point3d(dr.gather(mi.Vector3d, poses.position, azimuth))
        direction = poses.in_world(mi.Vector3d(self._forward, self._right, self._up), azimuth)
        count = dr.width(azimuth)
        return RayBatch(
            origin=origin,
            direction=direction,
            travelled=dr.zeros(mi.Float64, count),
            weight=dr.full(mi.Float, 1, count),
            azimuth=azimuth,
            number=dr.arange(mi.UInt32, count),
            density=self._density,
            gain=self._gain,
            drift=dr.zeros(mi.Float, count),
            moved=dr.zeros(mi.Bool, count),
            start=origin,
            heading=direction,
            only_targets=dr.full(mi.Bool, True, count),
        )

    def first_obstacle_m(self, hits: Hits, *, obstacle: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Return the distance of the first obstacle in the main beam of each azimuth.

        Args:
            hits: Hits of all primary rays.
            obstacle: Whether each instance is an obstacle (I,) bool.

        Returns:
            Distances (azimuths,) [m], inf where no obstacle was met.
        """
        counted = self._in_beam & hits.active.numpy() & obstacle[hits.instance.numpy()]
        distance = hits.distance.numpy()[counted].astype(np.float32)
        first = np.full(self._azimuths, np.inf, np.float32)
        for azimuths in self._sides:
            np.minimum.at(first, azimuths[counted], distance)
        return first

    def clear_share(self, hits: Hits, edges_m: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the share of the two-way beam of each azimuth that reaches given ranges.

        Each ray stands for its gain over the density with which it was drawn.

        Args:
            hits: Hits of all primary rays.
            edges_m: The ranges (K,), increasing [m].

        Returns:
            Shares (azimuths, K), 0 to 1.
        """
        distance_m = np.where(hits.active.numpy(), hits.distance.numpy(), np.inf)
        weight = np.square(self._gain.numpy().astype(np.float64)) / self._density.numpy()
        weight /= np.repeat(weight.reshape(self._azimuths, -1).sum(axis=1), self._rays)
        cell = self._azimuth.numpy() * np.int64(len(edges_m) + 1) + np.searchsorted(edges_m, distance_m)
        ended = np.bincount(cell, weight, self._azimuths * (len(edges_m) + 1)).reshape(self._azimuths, -1)
        return np.clip(1 - np.cumsum(ended, axis=1)[:, :-1], 0, 1).astype(np.float32)
