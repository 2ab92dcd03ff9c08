"""Traces one scan: rays of all azimuths together, bounce after bounce, into the echoes of each azimuth.

Read `Tracer.trace` first. The tracer holds what is the same in every scan; what one scan adds is its
`ScanState`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import CLASSES, Scene
from echoscape.scenes.core.targets import PlacedTarget
from echoscape.sim.echoes import Echoes, Returns
from echoscape.sim.raytracing.aimed_rays import SlenderFacets, aimed_share
from echoscape.sim.raytracing.beam_weighting import BeamEchoes, BeamWeighting
from echoscape.sim.raytracing.bounces import BounceSampler, RayBatch, RayReturns, ReturnPaths, joined, picked
from echoscape.sim.raytracing.displacement import Tolerance, displaced, tolerance
from echoscape.sim.raytracing.intersection import Hits, RayScene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.patches import Footprints, PatchSums
from echoscape.sim.raytracing.ray_sampling import PrimaryHits, PrimaryRays
from echoscape.sim.raytracing.scan_state import ScanState
from echoscape.sim.raytracing.surface.scattering import Surfaces
from echoscape.sim.raytracing.surface.speckle import hash32
from echoscape.sim.raytracing.targets.mirror_faces import MirrorFaces
from echoscape.sim.raytracing.targets.target_echoes import TargetEchoes
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.link_budget import link_w_m2, units_per_watt
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.surfaces import SurfaceSettings
from echoscape.sim.settings.tracing import TraceSettings

EXPECTED_BRDF = 0.3
"""BRDF [1/sr] of a rough wall at normal incidence: what a reflected ray is assumed to meet next."""
SAMPLES_BELOW = 8.0
"""A sample of a patch may be this much weaker than the weakest echo: many make one."""
LEAST_CHANCE = 0.1
"""A reflected ray is kept at least this often: it may meet a glint, which is a thousand times stronger."""
GROUND_CLASSES = tuple(CLASSES.index(name) for name in ("none", "ground", "road", "pavement", "kerb"))


class Tracer:
    """Traces scans of one sensor in one scene."""

    def __init__(
        self,
        sensor: Sensor,
        settings: TraceSettings,
        *,
        instance_class: NDArray[np.uint8],
        targets: Sequence[PlacedTarget] = (),
        seed: int,
        surfaces: SurfaceSettings | None = None,
        mirrors: MirrorFaces | None = None,
        at_rest: Scene | None = None,
    ) -> None:
        """Draw the primary rays and tabulate patterns and scattering.

        Args:
            sensor: The radar.
            settings: Number of rays, bounces and the floor.
            instance_class: Class id of every instance id, moving objects included (I,) uint8.
            targets: Test targets of the scene. Coherent ones return their phase sum; rays see them as
                mirrors and obstacles.
            seed: Decides ray directions, speckle and texture.
            surfaces: Changes to the roughness of the materials.
            mirrors: Faces in which coherent targets may be seen; None is none.
            at_rest: All that is at rest, at whose slender metal facets rays are aimed; None is nothing.
        """
        self._sensor = sensor
        self._settings = settings
        self._draw = dr.opaque(mi.UInt32, settings.draw & 0xFFFFFFFF)
        self.antenna = antenna = Antenna(sensor)
        self._primary = PrimaryRays(sensor, antenna, rays=settings.rays, seed=seed, draw=settings.draw)
        elevation = np.linspace(-math.pi / 2, math.pi / 2, len(antenna.elevation_grid_rad))
        gain = np.interp(
            elevation - math.radians(sensor.mount_tilt_deg),
            antenna.elevation_grid_rad,
            antenna.elevation_one_way,
        )
        self._bounces = BounceSampler(
            surfaces=Surfaces(sensor.carrier_hz, sensor.wavelength_m, surfaces),
            link=link_w_m2(sensor),
            elevation_gain=gain,
        )
        floor_units = sensor.noise_units * 10 ** (settings.floor_db / 10)
        self._floor_w = (
            floor_units / units_per_watt(sensor) / 10 ** (max(y for _, y in sensor.range_gain_db) / 10)
        )
        self._least_w = self._floor_w / SAMPLES_BELOW
        self._beam = BeamWeighting(sensor, antenna, floor_w=self._floor_w)
        self._patches = PatchSums(
            azimuths=sensor.azimuths, rays=settings.rays, floor_w=self._floor_w, seed=seed
        )
        self._slender = None
        if at_rest:
            self._slender = SlenderFacets(at_rest, sensor, antenna, seed=seed, draw=settings.draw)
        self._tolerance = tolerance(sensor, antenna)
        self._obstacle = ~np.isin(instance_class, GROUND_CLASSES)
        self._targets = TargetEchoes(
            targets, sensor, antenna, floor_w=self._floor_w, mirrors=mirrors, surfaces=surfaces
        )
        self._coherent = mi.Bool(np.isin(np.arange(len(instance_class)), self._targets.instances))

    def launch(self, state: ScanState) -> PrimaryHits:
        """Send the primary rays of a scan.

        Args:
            state: The scan.

        Returns:
            The rays and what each meets first.
        """
        rays = self._primary.rays(state.pose_tables)
        return PrimaryHits(rays=rays, hits=self._intersect(state.ray_scene, rays))

    def trace(self, state: ScanState, primary: PrimaryHits, *, ghosts: bool = True) -> Echoes:
        """Return the echoes of a scan.

        Args:
            state: The scan.
            primary: What its primary rays meet.
            ghosts: Whether to follow paths of more than one bounce; direct echoes do not depend on it.

        Returns:
            The echoes, without an origin.
        """
        max_bounces = self._settings.max_bounces if ghosts else 1
        rays, hits = primary.rays, primary.hits
        first_obstacle_m = self._primary.first_obstacle_m(hits, obstacle=self._obstacle)
        received: list[tuple[ReturnPaths, BeamEchoes] | None] = []
        met: list[_Met] = []
        for depth in range(1, max_bounces + 1):
            from_targets = rays.only_targets
            rays, heard = self._heard(rays, hits)
            met.append(_Met.of(rays, hits, count=self._primary.count))
            if depth == 1:
                received.append(self._direct_echoes(state, rays, heard))
            else:
                if 2 * depth - 1 <= max_bounces:
                    prints = self._same_path_footprints(rays, heard, depth=depth)
                    received.append(self._patch_echoes(state, prints))
                prints = self._loop_footprints(state, rays, heard, from_targets, depth=depth)
                received.append(self._patch_echoes(state, prints))
            if depth < max_bounces:
                onward = self._reflected(rays, hits, depth=depth)
                if onward is None:
                    break
                rays, hits = onward, self._intersect(state.ray_scene, onward)
        groups = [
            (_returns(paths, met, state.poses.position, self._tolerance), echoes)
            for paths, echoes in filter(None, received)
        ]
        targets = self._targets.echoes(state, max_bounces=max_bounces)
        return _joined_groups([*groups, targets] if targets else groups, first_obstacle_m)

    def clear_share(self, primary: PrimaryHits, edges_m: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the share of the two-way beam of each azimuth that reaches given ranges.

        Args:
            primary: What the primary rays of the scan meet.
            edges_m: The ranges (K,), increasing [m].

        Returns:
            Shares (azimuths, K), 0 to 1.
        """
        return self._primary.clear_share(primary.hits, edges_m)

    def _intersect(self, ray_scene: RayScene, rays: RayBatch) -> Hits:
        """Intersect rays with the scene up to the range of the sensor."""
        reach = self._sensor.range_m * 1.02 - mi.Float(rays.travelled)
        hits = ray_scene.intersect(rays.origin, rays.direction, rays.azimuth, reach, mi.Bool(reach > 0))
        dr.eval(rays, hits)
        return hits

    def _heard(self, rays: RayBatch, hits: Hits) -> tuple[RayBatch, Hits]:
        """Mark rays that met coherent targets alone so far, and drop hits on these.

        All that coherent targets return is in their phase sums.
        """
        if not self._targets.instances:
            return replace(rays, only_targets=dr.zeros(mi.Bool, dr.width(rays.number))), hits
        on_target = dr.gather(mi.Bool, self._coherent, hits.instance)
        rays = replace(rays, only_targets=rays.only_targets & on_target)
        hits = replace(hits, active=hits.active & ~on_target)
        dr.eval(rays.only_targets, hits.active)
        return rays, hits

    def _direct_echoes(
        self, state: ScanState, rays: RayBatch, hits: Hits
    ) -> tuple[ReturnPaths, BeamEchoes] | None:
        """Return the direct echoes; where rays are aimed at what a ray met, it counts for the rest only."""
        cosine = dr.abs(mi.Float(dr.dot(hits.normal, rays.direction)))
        share = aimed_share(hits.width, mi.Float(hits.distance), cosine)
        share = dr.select(self._primary.inside(rays.number), 1 - share, 1)
        prints = [self._same_path_footprints(rays, hits, depth=1, share=share), self._aimed_footprints(state)]
        found = [each for each in prints if each]
        return self._patch_echoes(state, joined(*found) if len(found) > 1 else found[0] if found else None)

    def _aimed_footprints(self, state: ScanState) -> Footprints | None:
        """Return what slender facets return to the rays aimed at them, None where nothing is."""
        if self._slender is None:
            return None
        aimed = self._slender.aimed_rays(state, first_number=self._primary.count)
        if aimed is None:
            return None
        rays, hits = aimed.rays, self._intersect(state.ray_scene, aimed.rays)
        met = hits.active & (dr.abs(hits.distance - aimed.range_m) < 1e-3) & (hits.width > 0)
        hits = replace(hits, active=met)
        dr.eval(hits.active)
        return self._same_path_footprints(*self._heard(rays, hits), depth=1)

    def _same_path_footprints(
        self, rays: RayBatch, hits: Hits, *, depth: int, share: "mi.Float | float" = 1.0
    ) -> Footprints | None:
        """Return the footprints of rays whose power along their outward path, times `share`, counts."""
        power = self._bounces.same_path_returns(rays, hits, depth=depth).power * share
        dr.eval(power)
        index = dr.compress(power > self._least_w)
        if len(index) == 0:
            return None
        rays, hits = picked(rays, index), picked(hits, index)
        found = self._bounces.same_path_returns(rays, hits, depth=depth)
        found.power = dr.gather(mi.Float, power, index)
        return self._patches.footprints(found, rays, hits)

    def _patch_echoes(
        self, state: ScanState, prints: Footprints | None
    ) -> tuple[ReturnPaths, BeamEchoes] | None:
        """Sum what rays return by patch of surface, and return the echoes of the patches."""
        paths = self._patches.paths(prints, state.pose_tables.position) if prints else None
        return self._beam.echoes(paths, state.pose_tables) if paths else None

    def _loop_footprints(
        self, state: ScanState, rays: RayBatch, hits: Hits, from_targets: "mi.Bool", *, depth: int
    ) -> Footprints | None:
        """Return the footprints of loops that count and whose last leg is free, None where there are none.

        Where rays come from coherent targets alone (`from_targets`), the mirror part of the last surface is
        in the phase sums of these targets.
        """
        poses = state.pose_tables

        def returns(rays: RayBatch, hits: Hits, from_targets: "mi.Bool") -> RayReturns:
            antenna = mi.Point3d(dr.gather(mi.Vector3d, poses.position, rays.azimuth))
            axis = poses.axis(rays.azimuth)
            return self._bounces.loop_returns(rays, hits, antenna, axis, mirrored=~from_targets, depth=depth)

        loops = returns(rays, hits, from_targets)
        gain = self._beam.largest_loop_gain(loops, rays.azimuth, poses)
        strong = (loops.power > self._least_w) & (loops.power * gain > self._least_w)
        dr.eval(loops.power, strong)
        index = dr.compress(strong)
        if len(index):
            hidden = self._hidden_from_antenna(state, picked(rays, index), picked(hits, index))
            index = dr.gather(mi.UInt32, index, dr.compress(~hidden))
        if len(index) == 0:
            return None
        rays, hits = picked(rays, index), picked(hits, index)
        found = returns(rays, hits, dr.gather(mi.Bool, from_targets, index))
        found.power = dr.gather(mi.Float, loops.power, index)
        return self._patches.footprints(found, rays, hits)

    def _hidden_from_antenna(self, state: ScanState, rays: RayBatch, hits: Hits) -> "mi.Bool":
        """Return whether anything lies between the antenna and what rays met (N)."""
        antenna = mi.Point3d(dr.gather(mi.Vector3d, state.pose_tables.position, rays.azimuth))
        start = hits.point + hits.normal * 1e-3
        home = antenna - start
        length = dr.norm(home)
        active = dr.full(mi.Bool, True, dr.width(rays.azimuth))
        hidden = state.ray_scene.occluded(start, home / length, rays.azimuth, mi.Float(length), active)
        dr.eval(hidden)
        return hidden

    def _reflected(self, rays: RayBatch, hits: Hits, *, depth: int) -> RayBatch | None:
        """Return the reflected rays that are worth following, None where there are none.

        A ray whose next return is likely to be weak is kept with the chance of that return over the floor,
        and its density falls by as much (Russian roulette; Arvo & Kirk 1990): fewer rays, the same mean.
        """
        onward = self._bounces.mirror_rays(rays, hits)
        likely = link_w_m2(self._sensor) * dr.square(onward.weight * rays.gain) * EXPECTED_BRDF / rays.density
        chance = likely / dr.square(mi.Float(onward.travelled)) / self._floor_w
        chance = dr.select(onward.weight > 1e-6, dr.clip(chance, LEAST_CHANCE, 1), 0)
        salt = hash32(mi.UInt32(0x51ED270B * depth) ^ self._draw)
        draw = mi.Float(hash32(rays.number ^ salt) >> 8) * (1.0 / 16777216.0)
        kept = draw < chance
        dr.eval(chance, kept)
        index = dr.compress(kept)
        if len(index) == 0:
            return None
        onward = self._bounces.mirror_rays(picked(rays, index), picked(hits, index))
        onward.density = onward.density * dr.gather(mi.Float, chance, index)
        return onward


@dataclass(frozen=True)
class _Met:
    """What rays met at one depth: instances (N), points (N) [m], and where in these each ray number is."""

    instance: "mi.UInt32"
    point: "mi.Point3d"
    place: "mi.UInt32"

    @staticmethod
    def of(rays: RayBatch, hits: Hits, *, count: int) -> "_Met":
        place = dr.zeros(mi.UInt32, count)
        dr.scatter(place, dr.arange(mi.UInt32, dr.width(rays.number)), rays.number)
        return _Met(hits.instance, hits.point, place)

    def by_number(self, number: "mi.UInt32") -> tuple["mi.UInt32", "mi.Point3d"]:
        """Return instances and points [m] of rays."""
        index = dr.gather(mi.UInt32, self.place, number)
        return dr.gather(mi.UInt32, self.instance, index), dr.gather(type(self.point), self.point, index)


def _returns(
    paths: ReturnPaths, met: Sequence[_Met], antenna: NDArray[np.float64], allowed: Tolerance
) -> Returns:
    """Describe return paths; a same-path return of order 2 d - 1 met d surfaces on its outward path.

    `antenna` is its position at each azimuth (azimuths, 3) [m].
    """
    count = dr.width(paths.azimuth)
    depth = paths.bounces if paths.back is not paths.out else (paths.bounces + 1) // 2
    instance = paths.instance.numpy()
    surfaces = [instance]
    wrong = np.zeros(count, np.bool_)
    if depth > 1:
        here = antenna.T[:, paths.azimuth.numpy()]
        reached = [each.by_number(paths.number) for each in met[:depth]]
        dr.eval(reached)
        surfaces = [surface.numpy() for surface, _ in reached]
        points = [point.numpy() - here for _, point in reached]
        wrong = displaced(paths.out.numpy() - here, paths.back.numpy() - here, points, allowed)
    return Returns(
        bounces=np.full(count, paths.bounces, np.uint8),
        instance=instance,
        material=paths.material.numpy().astype(np.uint8),
        moving=paths.moving.numpy(),
        surfaces=np.stack(surfaces, axis=1),
        coherent=np.zeros(count, np.bool_),
        displaced=wrong,
    )


def _joined_groups(
    groups: Sequence[tuple[Returns, BeamEchoes]], first_obstacle_m: NDArray[np.float32]
) -> Echoes:
    """Join the echoes of all groups of return paths."""
    starts = np.cumsum([0, *(len(returns.bounces) for returns, _ in groups)])
    deepest = max((returns.surfaces.shape[1] for returns, _ in groups), default=1)
    returns = Returns(
        bounces=_joined([each.bounces for each, _ in groups], np.uint8),
        instance=_joined([each.instance for each, _ in groups], np.uint32),
        material=_joined([each.material for each, _ in groups], np.uint8),
        moving=_joined([each.moving for each, _ in groups], np.bool_),
        surfaces=np.concatenate(
            [np.zeros((0, deepest), np.uint32)]
            + [np.pad(each.surfaces, ((0, 0), (0, deepest - each.surfaces.shape[1]))) for each, _ in groups]
        ),
        coherent=_joined([each.coherent for each, _ in groups], np.bool_),
        displaced=_joined([each.displaced for each, _ in groups], np.bool_),
    )
    return Echoes(
        azimuth=_joined([part.azimuth for _, part in groups], np.int32),
        range_m=_joined([part.range_m for _, part in groups], np.float64),
        amplitude=_joined([part.amplitude for _, part in groups], np.complex64),
        mean_power=_joined([part.mean_power for _, part in groups], np.float32),
        source=_joined(
            [part.source + np.uint32(start) for (_, part), start in zip(groups, starts, strict=False)],
            np.uint32,
        ),
        sidelobe=_joined([part.sidelobe for _, part in groups], np.bool_),
        closing_mps=_joined([part.closing_mps for _, part in groups], np.float32),
        returns=returns,
        first_obstacle_m=first_obstacle_m,
    )


def _joined(parts: list[NDArray], dtype: type) -> NDArray:
    return np.concatenate(parts) if parts else np.empty(0, dtype)
