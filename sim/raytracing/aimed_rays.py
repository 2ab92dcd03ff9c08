"""Rays aimed at slender metal facets that face the radar, which rays at random rarely meet.

Bars of railings, posts and rails of barriers are narrower than the distance between rays, and a mirror that
faces the radar returns a hundred thousand times the noise. A ray is sent to a point of every part of such a
facet: an integral over the area of the facets in place of the solid angle of the beam (next-event estimation;
Veach 1997, ch. 8). Facets go over from one kind of ray to the other by width and direction, each ray counting
for a share, so that both shares add up to one at every point.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from echoscape.scenes.core.scene import Prototype, Scene
from echoscape.sim.raytracing.bounces import RayBatch, joined, primary_batch
from echoscape.sim.raytracing.intersection import rotated_about_z
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.scan_state import PoseTables, ScanState
from echoscape.sim.raytracing.surface.slender_facets import SlenderParts, prototype_parts, slender_parts
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.sensor import Sensor

AIMED_STAGE = 308
"""Number of the random stage of the points that rays are aimed at."""
WIDTHS_RAD = (2e-3, 4e-3)
"""Widths of a facet, seen from the radar, below which rays are aimed at it and above which none are [rad]."""
LEVELS = (0.996, 0.993)
"""Cosines of incidence above which rays are aimed at a facet and below which none are, 5.1 and 6.8 deg: its
lobe is some 2 deg wide."""


@dataclass(frozen=True, kw_only=True)
class AimedRays:
    """Rays that are aimed at points.

    Attributes:
        rays: The rays (N).
        range_m: Distances of the points (N), double [m].
    """

    rays: RayBatch
    range_m: "mi.Float64"


def aimed_share(width_m: "mi.Float", range_m: "mi.Float", cosine: "mi.Float") -> "mi.Float":
    """Return the share of the power of a point that aimed rays count, the rest being that of other rays.

    Args:
        width_m: Widths of the facets (N), 0 for those that no ray is aimed at [m].
        range_m: Distances from the radar (N) [m].
        cosine: Cosines of incidence (N).

    Returns:
        Shares (N), 0 to 1.
    """
    low, high = WIDTHS_RAD
    narrow = dr.clip((high - width_m / range_m) / (high - low), 0, 1)
    facing = dr.clip((cosine - LEVELS[1]) / (LEVELS[0] - LEVELS[1]), 0, 1)
    return dr.select(width_m > 0, narrow * facing, 0)


class SlenderFacets:
    """Aims rays at the slender facets of a scene that may return more than the weakest echo."""

    def __init__(self, scene: Scene, sensor: Sensor, antenna: Antenna, *, seed: int, draw: int) -> None:
        """Divide the facets at rest.

        Args:
            scene: All that is at rest.
            sensor: The radar.
            antenna: Its patterns.
            seed: Decides the points of the facets that rays are aimed at.
            draw: Number of the draw of these points.
        """
        self._sensor = sensor
        self._key = int(np.random.SeedSequence((seed, AIMED_STAGE, draw)).generate_state(1, np.uint64)[0])
        self._gain = mi.Float(antenna.elevation_one_way.astype(np.float32))
        self._gain_steps = len(antenna.elevation_one_way) - 1
        self._at_rest = _PartTables.of(slender_parts(scene, key=self._key))
        self._prototypes: dict[str, SlenderParts] = {}

    def aimed_rays(self, state: ScanState, *, first_number: int) -> AimedRays | None:
        """Send a ray to each part that may be seen, at the time of the azimuth that points at it.

        Args:
            state: The scan.
            first_number: Number of the first of these rays in the scan.

        Returns:
            The rays; None where there are none.
        """
        near = self._near(state)
        still = self._aimed(state, near, lambda azimuth: near.place, first_number) if near else None
        if still is not None:
            first_number += dr.width(still.range_m)
        moving = self._at_movers(state, first_number)
        if still is None or moving is None:
            return still or moving
        return AimedRays(
            rays=joined(still.rays, moving.rays), range_m=dr.concat((still.range_m, moving.range_m))
        )

    def _near(self, state: ScanState) -> "_PartTables | None":
        """Return the parts at rest that may count at some azimuth of the scan, by bounds from its middle."""
        if self._at_rest.count == 0:
            return None
        track = state.poses.position
        middle = track[len(track) // 2]
        moved_m = float(np.linalg.norm(track - middle, axis=1).max())
        parts = self._at_rest
        away = mi.Vector3f(parts.place.point - mi.Vector3d(*middle.tolist()))
        nearest = dr.maximum(dr.norm(away) - moved_m, 1e-3)
        # From elsewhere in the scan a part is seen under another angle, up to moved / distance.
        cosine = dr.abs(dr.dot(away, parts.place.normal)) + 2 * moved_m
        wanted = (nearest < self._sensor.range_m * 1.02) & (
            parts.width < WIDTHS_RAD[1] * (nearest + 2 * moved_m)
        )
        wanted &= cosine > LEVELS[1] * nearest
        index = dr.compress(wanted)
        return parts.at(index) if len(index) else None

    def _at_movers(self, state: ScanState, first_number: int) -> AimedRays | None:
        """Send rays to the parts of moving objects in reach."""
        found = [self._parts_of(mover.prototype) for mover in state.movers.movers]
        counts = [len(parts.width_m) for parts in found]
        if not sum(counts):
            return None
        tables = _PartTables.of(_joined_parts(found))
        mover = mi.UInt32(np.repeat(np.arange(len(counts), dtype=np.uint32), counts))

        def place(azimuth: "mi.UInt32") -> _Place:
            local = mi.Vector3d(tables.place.point)
            point, cosine, sine = state.ray_scene.mover_points(local, mover, azimuth)
            normal = rotated_about_z(mi.Vector3d(tables.place.normal), cosine, sine)
            return _Place(point, mi.Vector3f(normal))

        return self._aimed(state, tables, place, first_number)

    def _parts_of(self, prototype: Prototype) -> SlenderParts:
        """Return the parts of a prototype, the same for all its objects and scans."""
        if prototype.name not in self._prototypes:
            self._prototypes[prototype.name] = prototype_parts(prototype, key=self._key)
        return self._prototypes[prototype.name]

    def _aimed(
        self,
        state: ScanState,
        tables: "_PartTables",
        place: "Callable[[mi.UInt32], _Place]",
        first_number: int,
    ) -> AimedRays | None:
        """Send rays to parts whose places depend on the azimuth at which they are seen."""
        poses = state.pose_tables
        azimuth = dr.zeros(mi.UInt32, tables.count)
        for _ in range(2):
            azimuth = self._azimuth(place(azimuth), azimuth, poses)
        at = place(azimuth)
        away = at.point - dr.gather(mi.Point3d, poses.position, azimuth)
        range_m = dr.norm(away)
        cosine = dr.abs(dr.dot(mi.Vector3f(away), at.normal)) / mi.Float(range_m)
        share = aimed_share(tables.width, mi.Float(range_m), cosine)
        wanted = (share > 0) & (range_m < self._sensor.range_m * 1.02)
        density = dr.square(mi.Float(range_m)) / dr.maximum(tables.area * cosine * share, 1e-12)
        direction = mi.Vector3d(away / range_m)
        gain = self._elevation_gain(mi.Vector3f(direction), poses.axis(azimuth))
        dr.eval(azimuth, range_m, density, direction, gain, wanted)
        index = dr.compress(wanted)
        if len(index) == 0:
            return None
        azimuth, range_m, density, direction, gain = (
            dr.gather(type(each), each, index) for each in (azimuth, range_m, density, direction, gain)
        )
        rays = primary_batch(
            origin=mi.Point3d(dr.gather(mi.Vector3d, poses.position, azimuth)),
            direction=direction,
            azimuth=azimuth,
            number=dr.arange(mi.UInt32, len(index)) + first_number,
            density=density,
            gain=gain,
        )
        return AimedRays(rays=rays, range_m=range_m)

    def _azimuth(self, at: "_Place", azimuth: "mi.UInt32", poses: PoseTables) -> "mi.UInt32":
        """Return the azimuth that points at each part as it is, and as the antenna is, at `azimuth` (N)."""
        away = mi.Vector3f(at.point - dr.gather(mi.Point3d, poses.position, azimuth))
        turns = (poses.bearing(away, azimuth) - self._sensor.first_azimuth_rad) * (1 / (2 * math.pi))
        place = (turns - dr.floor(turns)) * self._sensor.azimuths
        return mi.UInt32(dr.round(place)) % self._sensor.azimuths

    def _elevation_gain(self, direction: "mi.Vector3f", axis: "mi.Vector3f") -> "mi.Float":
        """Return the one-way elevation gain towards unit directions (N)."""
        elevation = dr.asin(dr.clip(dr.dot(direction, axis), -1, 1)) - math.radians(
            self._sensor.mount_tilt_deg
        )
        step = (elevation / math.pi + 0.5) * self._gain_steps
        return dr.gather(mi.Float, self._gain, mi.UInt32(dr.clip(step + 0.5, 0, self._gain_steps)))


@dataclass(frozen=True)
class _Place:
    """Points (N), double [m], and unit normals (N) of parts in the world."""

    point: "mi.Point3d"
    normal: "mi.Vector3f"


@dataclass(frozen=True)
class _PartTables:
    """Parts of slender facets as Dr.Jit arrays (N)."""

    count: int
    place: _Place
    width: "mi.Float"
    area: "mi.Float"

    @staticmethod
    def of(parts: SlenderParts) -> "_PartTables":
        point, normal = (np.ascontiguousarray(each.T) for each in (parts.point, parts.normal))
        return _PartTables(
            len(parts.width_m),
            _Place(mi.Point3d(point), mi.Vector3f(normal)),
            mi.Float(parts.width_m),
            mi.Float(parts.area_m2),
        )

    def at(self, index: "mi.UInt32") -> "_PartTables":
        """Return some of the parts (K)."""
        point, normal, width, area = (
            dr.gather(type(each), each, index)
            for each in (self.place.point, self.place.normal, self.width, self.area)
        )
        dr.eval(point, normal, width, area)
        return _PartTables(len(index), _Place(point, normal), width, area)


def _joined_parts(parts: Sequence[SlenderParts]) -> SlenderParts:
    names = [field.name for field in fields(SlenderParts)]
    return SlenderParts(**{name: np.concatenate([getattr(each, name) for each in parts]) for name in names})
