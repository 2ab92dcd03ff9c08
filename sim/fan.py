"""The fan of rays that every scan sends out: directions drawn once by row, pointed along each row's heading.

Where they point is `sim.directions`' draw from the two-way pattern; here they become rays in the world.
"""

import math

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.antenna import Antenna
from echoscape.sim.backend import dr, mi
from echoscape.sim.directions import draw_directions
from echoscape.sim.intersection import Hits
from echoscape.sim.motion import RowPoses
from echoscape.sim.paths import Rays
from echoscape.sim.sensor import Sensor

RAYS_STAGE = 300
"""Number of the stage that draws the directions of rays; those of scenes/ are smaller."""
_BEAM_DEG = (-6.0, 4.0)
"""Elevations between which a ray looks for the first obstacle of its row."""


class Fan:
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

    def rays(self, poses: RowPoses) -> Rays:
        """Point the directions along each row's heading from each row's place."""
        row = self._row
        cosine = dr.gather(mi.Float64, mi.Float64(np.cos(poses.yaw)), row)
        sine = dr.gather(mi.Float64, mi.Float64(np.sin(poses.yaw)), row)
        # Azimuth is clockwise from ahead: aside points right of the heading.
        x = cosine * self._forward + sine * self._aside
        y = sine * self._forward - cosine * self._aside
        origin = mi.Point3d(dr.gather(mi.Vector3d, mi.Float64(poses.position.ravel()), row))
        direction = mi.Vector3d(x, y, self._up)
        return Rays(
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
