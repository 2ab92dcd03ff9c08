"""Directions of the primary rays: a digital net in each azimuth, the same in every scan.

A hit serves every azimuth whose beam covers it. The density of the rays is even in azimuth, and in elevation
follows the antenna and level ground; the weight of a return in an azimuth is the gain of that azimuth over
the density (importance sampling).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.raytracing.bounces import RayBatch, primary_batch
from echoscape.sim.raytracing.intersection import Hits
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.scan_state import PoseTables
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.sensor import Sensor

RAYS_STAGE = 300
"""Number of the random stage of ray directions; those of scenes/ are smaller."""
_BEAM_DEG = (-6.0, 4.0)
"""Elevations between which a hit counts as the first obstacle of an azimuth."""
WIDE_SHARE = 0.12
"""Share of rays drawn in elevation from the one-way pattern, which is broader: for high facades, and for
paths that leave and return in different directions."""
GROUND_SHARE = 0.2
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


MARGIN_AZIMUTHS = 4
"""Azimuths by which the directions go on before the first and after the last azimuth, at the times of these:
what lies across the seam of the scan is within their main lobes."""


def draw_directions(antenna: Antenna, *, rays: int, rng: np.random.Generator) -> Directions:
    """Draw directions, even in azimuth, and in elevation as the antenna sees them.

    Those of an azimuth are a digital net: of its 2^m rays, one lies in each of the 2^m boxes of every shape
    2^-k x 2^(k - m) (Niederreiter 1992, ch. 4; Hammersley's points, their digits shifted at random).

    Args:
        antenna: The antenna patterns.
        rays: Number of rays per azimuth, a power of two from 16.
        rng: Draws the directions.

    Returns:
        Directions ((azimuths + 2 x margin) x rays).

    Raises:
        ValueError: `rays` is not a power of two from 16.
    """
    if rays < 16 or rays & (rays - 1):
        raise ValueError(f"rays must be a power of two from 16, got {rays}")
    sensor = antenna.sensor
    position = np.arange(-MARGIN_AZIMUTHS, sensor.azimuths + MARGIN_AZIMUTHS)
    shape = (len(position), rays)
    number = np.arange(rays)
    shift = rng.integers(rays, size=(2, len(position), 1))
    u = ((number ^ shift[0]) + rng.random(shape)) / rays
    v = ((_reversed_bits(rays) ^ shift[1]) + rng.random(shape)) / rays
    azimuth_rad = sensor.first_azimuth_rad + (position[:, None] + u - 0.5) * sensor.azimuth_step_rad
    elevation_density = _elevation_density(antenna)
    elevation = np.interp(v.ravel(), _cumulative(elevation_density), antenna.elevation_grid_rad)
    in_elevation = np.interp(elevation, antenna.elevation_grid_rad, elevation_density)
    azimuth = np.clip(position, 0, sensor.azimuths - 1).astype(np.uint32)
    return Directions(
        azimuth=np.repeat(azimuth, rays),
        azimuth_rad=azimuth_rad.ravel() % (2 * math.pi),
        elevation_rad=elevation,
        density=rays / sensor.azimuth_step_rad * in_elevation / np.cos(elevation),
    )


def _reversed_bits(count: int) -> NDArray[np.int64]:
    """Return the numbers below `count`, a power of two, with their binary digits in reverse order."""
    reverse = np.zeros(1, np.int64)
    while len(reverse) < count:
        reverse = np.concatenate([2 * reverse, 2 * reverse + 1])
    return reverse


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

    def __init__(self, sensor: Sensor, antenna: Antenna, *, rays: int, seed: int, draw: int = 0) -> None:
        """Draw the directions.

        Args:
            sensor: The radar.
            antenna: Its patterns.
            rays: Number of rays per azimuth, a power of two.
            seed: Decides the directions, with `draw`.
            draw: Number of the draw, from 0.
        """
        rng = np.random.default_rng(np.random.SeedSequence([seed, RAYS_STAGE, draw]))
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
        return primary_batch(
            origin=origin,
            direction=direction,
            azimuth=azimuth,
            number=dr.arange(mi.UInt32, dr.width(azimuth)),
            density=self._density,
            gain=self._gain,
        )

    def inside(self, number: "mi.UInt32") -> "mi.Bool":
        """Return which rays point to their own side of the seam between the last azimuth and the first.

        Args:
            number: Numbers of rays (N).

        Returns:
            False for those of the margins (N).
        """
        margin = MARGIN_AZIMUTHS * self._rays
        return (number >= margin) & (number < margin + self._azimuths * self._rays)

    @property
    def count(self) -> int:
        """Number of rays of a scan."""
        return dr.width(self._azimuth)

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
        azimuth = self._azimuth.numpy()
        weight /= np.bincount(azimuth, weight, self._azimuths)[azimuth]
        cell = azimuth * np.int64(len(edges_m) + 1) + np.searchsorted(edges_m, distance_m)
        ended = np.bincount(cell, weight, self._azimuths * (len(edges_m) + 1)).reshape(self._azimuths, -1)
        return np.clip(1 - np.cumsum(ended, axis=1)[:, :-1], 0, 1).astype(np.float32)
