"""Traces one scan: rays of all rows at once, bounce after bounce, into the echoes that each row hears.

Read `Tracer.trace` first. Settings and what stays the same from scan to scan live in the Tracer; a scan gives
the radar's poses by row and the movers' states.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import CLASSES
from echoscape.scenes.core.targets import PlacedTarget
from echoscape.sim.echoes import Echoes, Returns
from echoscape.sim.kinematics.rolling_scan import AzimuthPoses, MoverStates
from echoscape.sim.raytracing.beam_weighting import BeamEchoes, BeamWeighting
from echoscape.sim.raytracing.bounces import BounceSampler, RayBatch, ReturnPaths, picked
from echoscape.sim.raytracing.intersection import Hits, RayScene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.mitsuba_scene import MitsubaScene
from echoscape.sim.raytracing.ray_sampling import PrimaryRays
from echoscape.sim.raytracing.surface.scattering import Surfaces
from echoscape.sim.raytracing.surface.speckle import hash32
from echoscape.sim.raytracing.target_echoes import TargetEchoes
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.link_budget import link_w_m2, units_per_watt
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.surfaces import SurfaceSettings
from echoscape.sim.settings.tracing import TraceSettings

LIKELY_BRDF = 0.3
"""Scattering [1/sr] of a rough wall met head on: what a mirrored ray is assumed to meet next."""
LEAST_CHANCE = 0.1
"""A mirrored ray goes on at least this often: it may meet a glint, which is a thousand times brighter."""
GROUND_CLASSES = tuple(CLASSES.index(name) for name in ("none", "ground", "road", "pavement", "kerb"))


class Tracer:
    """Traces scans of one sensor in one town."""

    def __init__(
        self,
        scene: MitsubaScene,
        sensor: Sensor,
        settings: TraceSettings,
        *,
        instance_class: NDArray[np.uint8],
        targets: Sequence[PlacedTarget] = (),
        seed: int,
        surfaces: SurfaceSettings | None = None,
    ) -> None:
        """`instance_class` (I,) names the class of every instance id, movers included.

        Coherent ones among the `targets` send back their phase sum; rays see them as mirrors and obstacles.
        """
        self._scene = scene
        self._sensor = sensor
        self._settings = settings
        self.antenna = antenna = Antenna(sensor)
        self._fan = PrimaryRays(sensor, antenna, rays=settings.rays, seed=seed)
        world_elevation = np.linspace(-math.pi / 2, math.pi / 2, len(antenna.elevation_grid_rad))
        gain = np.interp(
            world_elevation - math.radians(sensor.mount_tilt_deg),
            antenna.elevation_grid_rad,
            antenna.elevation_one_way,
        )
        self._scatterer = BounceSampler(
            surfaces=Surfaces(sensor.carrier_hz, sensor.wavelength_m, surfaces),
            link=link_w_m2(sensor),
            elevation_gain=gain,
            seed=seed,
        )
        floor_units = sensor.noise_units * 10 ** (settings.floor_db / 10)
        self._floor_w = (
            floor_units / units_per_watt(sensor) / 10 ** (max(y for _, y in sensor.range_gain_db) / 10)
        )
        self._hearing = BeamWeighting(sensor, antenna, floor_w=self._floor_w)
        self._obstacle = ~np.isin(instance_class, GROUND_CLASSES)
        self._targets = TargetEchoes(targets, sensor, antenna, floor_w=self._floor_w)
        coherent = np.isin(np.arange(len(instance_class)), self._targets.instances)
        self._coherent = mi.Bool(coherent)

    def trace(self, poses: AzimuthPoses, states: MoverStates, *, ghosts: bool = True) -> Echoes:
        """Return the echoes of one scan for the antenna at `poses` and the movers at `states`.

        Without `ghosts` only direct echoes are looked for; they are the same as with them.
        """
        max_bounces = self._settings.max_bounces if ghosts else 1
        world = RayScene(self._scene, states, self._sensor.azimuths)
        self._hearing.place(poses)
        rays = self._fan.rays(poses)
        heard: list[tuple[ReturnPaths, BeamEchoes] | None] = []
        met: list[_Met] = []
        first_m = np.full(self._sensor.azimuths, np.inf, np.float32)
        for depth in range(1, max_bounces + 1):
            hits = self._meet(world, rays)
            if depth == 1:
                first_m = self._fan.first_obstacle_m(hits, obstacle=self._obstacle)
            index = dr.compress(hits.active)
            if len(index) == 0:
                break
            rays, hits = picked(rays, index), picked(hits, index)
            rays.only_targets &= dr.gather(mi.Bool, self._coherent, hits.instance)
            dr.eval(rays, hits)
            met.append(_Met(rays.number.numpy(), hits.instance.numpy()))
            if 2 * depth - 1 <= max_bounces:
                heard.append(self._hearing.hear(self._scatterer.same_path(rays, hits, depth=depth)))
            if depth > 1:
                loops = self._loops(world, rays, hits, poses, depth=depth)
                heard.append(self._hearing.hear(loops) if loops else None)
            if depth < max_bounces:
                onward = self._onward(rays, hits, depth=depth)
                if onward is None:
                    break
                rays = onward
        parts = [(_returns(paths, met), part) for paths, part in filter(None, heard)]
        targets = self._targets.hear(world, poses)
        return _gathered([*parts, targets] if targets else parts, first_m)

    def clear_share(
        self, poses: AzimuthPoses, states: MoverStates, edges_m: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """Return the share of each row's two-way beam that reaches ranges (azimuths, len(edges_m)).

        edges_m: increasing [m].
        """
        world = RayScene(self._scene, states, self._sensor.azimuths)
        return self._fan.clear_share(self._meet(world, self._fan.rays(poses)), edges_m)

    def _meet(self, world: RayScene, rays: RayBatch) -> Hits:
        """Intersect rays with the world as far as the sensor can hear."""
        reach = self._sensor.range_m * 1.02 - mi.Float(rays.travelled)
        hits = world.meet(rays.origin, rays.direction, rays.row, reach, mi.Bool(reach > 0))
        dr.eval(rays, hits)
        return hits

    def _loops(
        self, world: RayScene, rays: RayBatch, hits: Hits, poses: AzimuthPoses, *, depth: int
    ) -> ReturnPaths | None:
        """Return the loop returns of hits that would be heard and that see the radar, None without any."""
        sensor = mi.Point3d(dr.gather(mi.Vector3d, mi.Float64(poses.position.ravel()), rays.row))
        loops = self._scatterer.loop(rays, hits, sensor, depth=depth)
        loud = loops.power * self._hearing.loop_gain(loops) > self._floor_w
        start = hits.place + hits.normal * 1e-3
        dr.eval(loops, loud, start, sensor)
        index = dr.compress(loud)
        if len(index) == 0:
            return None
        loops, start, sensor = (
            picked(loops, index),
            dr.gather(type(start), start, index),
            dr.gather(type(sensor), sensor, index),
        )
        way = sensor - start
        length = dr.norm(way)
        hidden = world.blocked(
            start, way / length, loops.row, mi.Float(length), dr.full(mi.Bool, True, len(index))
        )
        dr.eval(loops, hidden)
        index = dr.compress(~hidden)
        return picked(loops, index) if len(index) else None

    def _onward(self, rays: RayBatch, hits: Hits, *, depth: int) -> RayBatch | None:
        """Return the mirrored rays that are worth following, None without any.

        A ray whose next return is likely to be weak goes on with the chance of that return over the floor,
        and stands for as many more (Russian roulette; Arvo & Kirk 1990): the mean stays, the work shrinks.
        """
        onward = self._scatterer.mirrored(rays, hits)
        likely = link_w_m2(self._sensor) * dr.square(onward.weight * rays.gain) * LIKELY_BRDF / rays.density
        chance = likely / dr.square(mi.Float(onward.travelled)) / self._floor_w
        chance = dr.select(onward.weight > 1e-6, dr.clip(chance, LEAST_CHANCE, 1), 0)
        lot = mi.Float(hash32(rays.number ^ (0x51ED270B * depth)) >> 8) * (1.0 / 16777216.0)
        onward.density = rays.density * chance
        goes = lot < chance
        dr.eval(onward, goes)
        index = dr.compress(goes)
        return picked(onward, index) if len(index) else None


@dataclass(frozen=True)
class _Met:
    """What rays met at one depth: numbers (N,) increasing, instances (N,)."""

    number: NDArray[np.uint32]
    instance: NDArray[np.uint32]


def _returns(paths: ReturnPaths, met: Sequence[_Met]) -> Returns:
    """Return what the paths are; a same-path return of order 2 d - 1 met d surfaces on its way out."""
    number, count = paths.number.numpy(), dr.width(paths.row)
    depth = paths.bounces if paths.back is not paths.out else (paths.bounces + 1) // 2
    surfaces = [each.instance[np.searchsorted(each.number, number)] for each in met[:depth]]
    return Returns(
        bounces=np.full(count, paths.bounces, np.uint8),
        instance=paths.instance.numpy(),
        material=paths.material.numpy().astype(np.uint8),
        moving=paths.moving.numpy(),
        surfaces=np.stack(surfaces, axis=1),
        coherent=np.zeros(count, np.bool_),
    )


def _gathered(heard: Sequence[tuple[Returns, BeamEchoes]], first_m: NDArray[np.float32]) -> Echoes:
    """Join the echoes of all groups of returns."""
    starts = np.cumsum([0, *(len(returns.bounces) for returns, _ in heard)])
    deepest = max((returns.surfaces.shape[1] for returns, _ in heard), default=1)
    returns = Returns(
        bounces=_joined([each.bounces for each, _ in heard], np.uint8),
        instance=_joined([each.instance for each, _ in heard], np.uint32),
        material=_joined([each.material for each, _ in heard], np.uint8),
        moving=_joined([each.moving for each, _ in heard], np.bool_),
        surfaces=np.concatenate(
            [np.zeros((0, deepest), np.uint32)]
            + [np.pad(each.surfaces, ((0, 0), (0, deepest - each.surfaces.shape[1]))) for each, _ in heard]
        ),
        coherent=_joined([each.coherent for each, _ in heard], np.bool_),
    )
    return Echoes(
        azimuth=_joined([part.row for _, part in heard], np.int32),
        range_m=_joined([part.range_m for _, part in heard], np.float64),
        amplitude=_joined([part.amplitude for _, part in heard], np.complex64),
        mean_power=_joined([part.mean_power for _, part in heard], np.float32),
        source=_joined(
            [part.source + np.uint32(start) for (_, part), start in zip(heard, starts, strict=False)],
            np.uint32,
        ),
        sidelobe=_joined([part.sidelobe for _, part in heard], np.bool_),
        closing_mps=_joined([part.closing_mps for _, part in heard], np.float32),
        returns=returns,
        first_m=first_m,
    )


def _joined(parts: list[NDArray], dtype: type) -> NDArray:
    return np.concatenate(parts) if parts else np.empty(0, dtype)
