"""The echoes of coherent test targets in the azimuths that receive them, beside those that rays find.

Each target is summed over its surface (`sim.raytracing.physical_optics`) from where the antenna is when the
beam passes it, and again whenever the antenna has moved enough to change the phases of the sum; hidden paths
are left out. The sum is kept apart in range, in steps well below the resolution: a long slanting target is
spread in range, while the bounces of a corner, all as long as the path to its apex, add up there.

Targets are seen in plane mirrors as well (`sim.raytracing.target_mirrors`): directly out and back by way of a
mirror, both ways round in phase, and out and back by way of the same or of two mirrors. The antenna's image
takes its place in the sum, and direct and mirrored echoes interfere by the lengths of their paths, as the two
rays over smooth ground do. A leg by way of two mirrors is left out.
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.attitude import bearing_and_elevation
from echoscape.scenes.core.materials import MATERIAL_NAMES, MATERIALS
from echoscape.scenes.core.targets import KINDS, PlacedTarget, Target
from echoscape.sim.echoes import Returns
from echoscape.sim.kinematics.rolling_scan import AzimuthPoses
from echoscape.sim.numerics.angles import principal_angle
from echoscape.sim.raytracing.beam_weighting import MAIN_AZIMUTHS, BeamEchoes
from echoscape.sim.raytracing.displacement import displaced, tolerance
from echoscape.sim.raytracing.intersection import RayScene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.physical_optics import SurfacePaths, Vectors, largest_sum, surface_paths
from echoscape.sim.raytracing.scan_state import ScanState
from echoscape.sim.raytracing.surface.fresnel import permittivity
from echoscape.sim.raytracing.target_mirrors import (
    Mirror,
    MirrorFaces,
    MirrorLegs,
    TargetMirrors,
    specular_points,
)
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.link_budget import link_w_m2
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.surfaces import SurfaceSettings

_SKIN_M = 5e-3
_STEPS_PER_RESOLUTION = 8
_MOST_PHASE = 0.1
"""Change of phase over a target [cycles] after which its sum is computed again."""
_MOST_SHIFT = 0.01
"""Movement of the antenna over the range after which it is computed again."""
_LEAST_SHARE = 0.1
"""Mirrors that fill less of the Fresnel zone, as a share of the amplitude, are left out."""
_FAINT = 0.01
"""Routes by way of mirrors are left where their power at its largest is below this share of the floor."""
_BOUND_SLACK = 2.0
"""Power of an echo over the estimate of its largest power, at most: beams are not quite even."""


@dataclass(frozen=True, kw_only=True)
class _Leg:
    """A way between the antenna and a target, at each azimuth (A,) of a scan.

    mirror: None where it is direct; image (3,): where the antenna sees the target's reference point [m];
    range_m of this image, offset_rad of it from the beam, closing_mps; beyond_rad: angle between the beam and
    the nearest part of the target; share of the amplitude that mirror and obstacles leave.
    """

    mirror: Mirror | None
    image: NDArray[np.float64]
    range_m: NDArray[np.float64]
    offset_rad: NDArray[np.float64]
    closing_mps: NDArray[np.float64]
    beyond_rad: NDArray[np.float64]
    share: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class _Route:
    """A target and the legs out to it and back; where they differ, the way round is taken both ways."""

    placed: PlacedTarget
    out: _Leg
    back: _Leg

    @property
    def target(self) -> Target:
        """The target."""
        return self.placed.target

    @property
    def legs(self) -> tuple[_Leg, _Leg]:
        """Both legs."""
        return self.out, self.back

    @property
    def bounces(self) -> int:
        """Surfaces met out and back; the bounces within a target are one."""
        return 1 + sum(leg.mirror is not None for leg in self.legs)

    @property
    def ways(self) -> int:
        """In how many directions the route is taken."""
        return 1 if self.out is self.back else 2

    @cached_property
    def range_m(self) -> NDArray[np.float64]:
        """Half the length of the route at each azimuth (A,) [m]."""
        return (self.out.range_m + self.back.range_m) / 2

    @cached_property
    def closing_mps(self) -> NDArray[np.float64]:
        """Its rate of change (A,), positive when it shortens [m/s]."""
        return (self.out.closing_mps + self.back.closing_mps) / 2

    @cached_property
    def share(self) -> NDArray[np.float64]:
        """Share of the amplitude (A,) that mirrors and obstacles leave."""
        return self.out.share * self.back.share

    @property
    def surfaces(self) -> list[int]:
        """Instance ids of the surfaces on the way out; of the direct leg and another, the other is it."""
        mirrors = [leg.mirror.instance for leg in self.legs if leg.mirror is not None]
        return [*mirrors[:1], self.placed.instance]


@dataclass(frozen=True, kw_only=True)
class _RangeSums:
    """A sum kept apart in range: half the path range_m (K,) [m], amplitude (K,) complex128 [sqrt(W)]."""

    range_m: NDArray[np.float64]
    amplitude: NDArray[np.complex128]

    @property
    def largest_w(self) -> float:
        """Largest power in one step of range [W]."""
        return float(np.max(np.square(np.abs(self.amplitude)), initial=0.0))

    def scaled(self, factor: float) -> "_RangeSums":
        """Return the sum times a factor on the amplitude."""
        return replace(self, amplitude=self.amplitude * factor)


class TargetEchoes:
    """Computes the echoes of the coherent targets of a scene."""

    def __init__(
        self,
        targets: Sequence[PlacedTarget],
        sensor: Sensor,
        antenna: Antenna,
        *,
        floor_w: float,
        mirrors: MirrorFaces | None = None,
        surfaces: SurfaceSettings | None = None,
    ) -> None:
        """Take the targets.

        Args:
            targets: Targets of the scene; those that are not coherent are left to the rays.
            sensor: The radar.
            antenna: Its patterns.
            floor_w: Power below which echoes are left out [W].
            mirrors: Faces in which the targets may be seen; None is none.
            surfaces: Changes to the roughness of the mirrors; None is none.
        """
        self._placed = [each for each in targets if each.target.coherent]
        self._sensor, self._antenna, self._floor_w = sensor, antenna, floor_w
        self._scale = math.sqrt(link_w_m2(sensor)) / sensor.wavelength_m
        self._shift_s = sensor.doppler_shift_s
        self._step_m = sensor.resolution_m / _STEPS_PER_RESOLUTION
        self._azimuth_rad = sensor.azimuth_rad
        self._main_rad = (MAIN_AZIMUTHS + 0.5) * sensor.azimuth_step_rad
        self._tolerance = tolerance(sensor, antenna)
        pattern, right = antenna.azimuth_two_way, antenna.azimuth_grid_rad >= 0
        largest = np.maximum.accumulate(np.maximum(pattern, pattern[::-1])[right][::-1])[::-1]
        self._largest_gains = antenna.azimuth_grid_rad[right], largest
        self._mirrors = None
        if mirrors is not None and self._placed:
            self._mirrors = TargetMirrors(
                mirrors,
                carrier_hz=sensor.carrier_hz,
                wavelength_m=sensor.wavelength_m,
                reach_m=2 * sensor.range_m,
                surfaces=surfaces,
            )

    @property
    def instances(self) -> list[int]:
        """Instance ids of the coherent targets."""
        return [each.instance for each in self._placed]

    def echoes(self, state: ScanState, *, max_bounces: int = 1) -> tuple[Returns, BeamEchoes] | None:
        """Return the echoes of the coherent targets in a scan.

        Args:
            state: The scan.
            max_bounces: Most surfaces that a path meets, out and back; the target is one of them.

        Returns:
            The targets, directly and in mirrors, as return paths, and their echoes; None where nothing is
            received.
        """
        if not self._placed:
            return None
        routes = self._routes(state, max_bounces)
        parts = [
            echoes for number, route in enumerate(routes) for echoes in self._echoes_of(route, number, state)
        ]
        if not parts:
            return None
        names = [field.name for field in fields(BeamEchoes)]
        joined = {name: np.concatenate([getattr(each, name) for each in parts]) for name in names}
        return self._returns(routes, state.poses), BeamEchoes(**joined)

    def _returns(self, routes: Sequence[_Route], poses: AzimuthPoses) -> Returns:
        """Describe routes as return paths."""
        count = len(routes)
        deepest = max(len(each.surfaces) for each in routes)
        padded = [[*each.surfaces, *[0] * (deepest - len(each.surfaces))] for each in routes]
        return Returns(
            bounces=np.array([each.bounces for each in routes], np.uint8),
            instance=np.array([each.placed.instance for each in routes], np.uint32),
            material=np.array([MATERIAL_NAMES.index(each.target.material) for each in routes], np.uint8),
            moving=np.zeros(count, np.bool_),
            surfaces=np.array(padded, np.uint32),
            coherent=np.ones(count, np.bool_),
            displaced=np.array([self._displaced(each, poses) for each in routes], np.bool_),
        )

    def _displaced(self, route: _Route, poses: AzimuthPoses) -> bool:
        """Whether a route shows its target where neither this nor a mirror is."""
        mirrors = [leg.mirror for leg in route.legs if leg.mirror is not None]
        if not mirrors:
            return False
        antenna = poses.position[np.argmin(np.abs(route.out.offset_rad) + np.abs(route.back.offset_rad))]
        position = np.array(route.target.position_m)
        met = [position]
        for each in mirrors:
            plane = each.normal[None], np.array([each.offset_m])
            met.append(specular_points(*plane, antenna[None], position[None])[0])
        out, back = ((leg.image - antenna)[:, None] for leg in route.legs)
        surfaces = [(point - antenna)[:, None] for point in met]
        return bool(displaced(out, back, surfaces, self._tolerance)[0])

    def _routes(self, state: ScanState, max_bounces: int) -> list[_Route]:
        """Return the routes of all targets: the direct ones, then those by way of mirrors."""
        direct = [self._leg(each.target, None, state.poses) for each in self._placed]
        routes = [
            _Route(placed=placed, out=leg, back=leg) for placed, leg in zip(self._placed, direct, strict=True)
        ]
        if self._mirrors is None or max_bounces < 2:
            return routes
        mirrored = self._mirrored_legs(self._mirrors, direct, state)
        for placed, leg, others in zip(self._placed, direct, mirrored, strict=True):
            pairs = itertools.combinations_with_replacement([leg, *others], 2)
            found = [_Route(placed=placed, out=out, back=back) for out, back in pairs][1:]
            routes += [each for each in found if each.bounces <= max_bounces]
        return routes

    def _mirrored_legs(
        self, mirrors: TargetMirrors, direct: Sequence[_Leg], state: ScanState
    ) -> list[list[_Leg]]:
        """Return the legs to each target by way of mirrors that show some of it, the targets in order."""
        poses = state.poses
        legs = [
            [
                self._leg(placed.target, mirror, poses)
                for mirror in self._mirrors_of(mirrors, placed.target, poses)
            ]
            for placed in self._placed
        ]
        for exact in (False, True):
            wanted = [
                MirrorLegs(
                    target=placed.target,
                    mirror=leg.mirror,
                    azimuth=self._covering(leg, straight, exact=exact),
                )
                for placed, straight, others in zip(self._placed, direct, legs, strict=True)
                for leg in others
                if leg.mirror is not None
            ]
            if not wanted:
                break
            filled = iter(mirrors.filled_shares(wanted, poses.position, state.ray_scene, exact=exact))
            for each, leg in zip(wanted, itertools.chain.from_iterable(legs), strict=True):
                leg.share[:] = _by_nearest(each.azimuth, next(filled), len(leg.share))
            legs = [[leg for leg in others if leg.share.max() >= _LEAST_SHARE] for others in legs]
        return legs

    def _mirrors_of(self, mirrors: TargetMirrors, target: Target, poses: AzimuthPoses) -> list[Mirror]:
        """Return the mirrors that may show a target in a scan."""
        axes = poses.axes[len(poses.yaw) // 2]

        def nearest_azimuth(towards: Vectors) -> NDArray[np.int64]:
            turned = bearing_and_elevation(axes, towards)[0] - self._azimuth_rad[0]
            return np.rint(turned / self._sensor.azimuth_step_rad).astype(np.int64) % self._sensor.azimuths

        return mirrors.mirrors(np.array(target.position_m), poses.position, nearest_azimuth)

    def _covering(self, leg: _Leg, straight: _Leg, *, exact: bool) -> NDArray[np.int64]:
        """Return azimuths that cover a leg or the direct one: all in their main lobes, or the middle ones."""
        if not exact:
            return np.unique([np.argmin(leg.beyond_rad), np.argmin(straight.beyond_rad)])
        return np.flatnonzero(self._main(leg) | self._main(straight))

    def _leg(self, target: Target, mirror: Mirror | None, poses: AzimuthPoses) -> _Leg:
        """Return a leg; the share of one by way of a mirror is still 0."""
        image = np.array(target.position_m)
        if mirror is not None:
            image = mirror.image(image)
        away = image - poses.position
        range_m = np.maximum(np.linalg.norm(away, axis=1), 1e-3)
        offset = principal_angle(bearing_and_elevation(poses.axes, away)[0] - self._azimuth_rad)
        return _Leg(
            mirror=mirror,
            image=image,
            range_m=range_m,
            offset_rad=offset,
            closing_mps=np.einsum("ak,ak->a", poses.velocity, away) / range_m,
            beyond_rad=np.abs(offset) - np.arctan(target.reach_m / range_m),
            share=np.full(len(range_m), float(mirror is None)),
        )

    def _main(self, leg: _Leg) -> NDArray[np.bool_]:
        """Return the azimuths (A,) whose main lobe covers a leg."""
        main = leg.beyond_rad <= self._main_rad
        # In a left turn it may lie between the main lobes of the last and the first azimuth.
        main[np.argmin(leg.beyond_rad)] = True
        return main

    def _echoes_of(self, route: _Route, number: int, state: ScanState) -> list[BeamEchoes]:
        """Return the echoes of one route, azimuth by azimuth."""
        covered = [self._main(leg) for leg in route.legs]
        main, sidelobe = covered[0] | covered[1], ~(covered[0] & covered[1])
        near, aside = np.flatnonzero(main), np.flatnonzero(~main)
        nearest = near[np.argmin(np.abs(near[None] - aside[:, None]), axis=1)]
        aside, nearest = self._loud(route, aside, nearest)
        near = np.union1d(self._loud(route, near, near)[0], nearest)
        gain = self._route_gain(route)
        parts, reference, paths = [], -1, None
        if route.bounces > 1:
            if len(near) == 0:
                return []
            reference = int(near[np.argmax(np.square(route.share[near]) * gain[near])])
            paths = self._visible_paths(route, reference, state)
            if self._faint(route, paths, reference, state):
                return []
        for azimuth in near.tolist():
            if paths is None or self._phases_changed(route, state.poses, reference, azimuth):
                reference, paths = azimuth, self._visible_paths(route, azimuth, state)
            if len(paths.path_m) == 0:
                continue
            share = float(route.share[azimuth])
            sums = self._range_sums(paths, state.poses, azimuth, weighted=True).scaled(share)
            parts.append(
                self._beam_echoes(sums, number, route, reference, azimuth, sidelobe=bool(sidelobe[azimuth]))
            )
            sides = aside[nearest == azimuth]
            if len(sides) == 0:
                continue
            sums = self._range_sums(paths, state.poses, azimuth, weighted=False).scaled(share)
            for side in sides[sums.largest_w * gain[sides] > self._floor_w / _BOUND_SLACK].tolist():
                weighted = sums.scaled(math.sqrt(gain[side]))
                parts.append(self._beam_echoes(weighted, number, route, reference, side, sidelobe=True))
        return [each for each in parts if len(each.azimuth)]

    def _faint(self, route: _Route, paths: SurfacePaths, azimuth: int, state: ScanState) -> bool:
        """Whether a route stays far below the floor, by its paths at the azimuth that covers it best."""
        if len(paths.path_m) == 0:  # something may just pass by
            return False
        sums = self._range_sums(paths, state.poses, azimuth, weighted=True)
        return sums.scaled(float(route.share[azimuth])).largest_w < self._floor_w * _FAINT

    def _route_gain(self, route: _Route) -> NDArray[np.float64]:
        """Return the two-way azimuth power gain of a route to its reference point (A,)."""
        if route.out is route.back:
            return self._azimuth_gain(route.out.offset_rad)
        return np.sqrt(self._azimuth_gain(route.out.offset_rad) * self._azimuth_gain(route.back.offset_rad))

    def _loud(
        self, route: _Route, azimuth: NDArray[np.int64], reference: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return those azimuths (K,) whose echoes may exceed the floor, and their references."""
        amplitude = self._scale * route.ways * largest_sum(route.target, self._sensor.wavelength_m)
        gain = np.ones(len(azimuth))
        for leg in route.legs:
            near_m = leg.range_m[azimuth] - route.target.reach_m
            amplitude = np.divide(amplitude, near_m, out=np.full(len(azimuth), np.inf), where=near_m > 0)
            gain = gain * self._largest_gain(np.maximum(leg.beyond_rad[azimuth], 0.0))
        power = np.square(amplitude) * np.square(route.share[reference]) * np.sqrt(gain)
        loud = power > self._floor_w / _BOUND_SLACK
        return azimuth[loud], reference[loud]

    def _largest_gain(self, offset_rad: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the largest two-way azimuth power gain at offsets (K,) and beyond [rad]."""
        return np.interp(offset_rad, *self._largest_gains)

    def _phases_changed(self, route: _Route, poses: AzimuthPoses, reference: int, azimuth: int) -> bool:
        """Whether the antenna moved so far between two azimuths that the phases over the target changed."""
        moved = float(np.linalg.norm(poses.position[azimuth] - poses.position[reference]))
        range_m = min(float(leg.range_m[azimuth]) for leg in route.legs)
        cycles = 2 * moved * _lever_m(route, range_m) / (range_m * self._sensor.wavelength_m)
        return cycles > _MOST_PHASE or moved > _MOST_SHIFT * range_m

    def _visible_paths(self, route: _Route, azimuth: int, state: ScanState) -> SurfacePaths:
        """Return the paths of a route over its target at an azimuth, with the points where they are seen.

        Of direct legs those are left out that something hides; mirrored ones carry the mirror's coefficient.
        """
        antenna, wavelength_m = state.poses.position[azimuth], self._sensor.wavelength_m
        ends = [antenna if leg.mirror is None else leg.mirror.image(antenna) for leg in route.legs]
        paths = surface_paths(
            route.target,
            ends[0],
            receiver=None if route.out is route.back else ends[1],
            wavelength_m=wavelength_m,
            epsilon=permittivity(MATERIALS[route.target.material], self._sensor.carrier_hz),
        )
        if len(paths.path_m) == 0:
            return paths
        met = [(route.out, paths.first), (route.back, paths.last)]
        hidden = np.zeros(len(paths.path_m), np.bool_)
        for leg, points in met[: 1 if _one_way(route, paths) else 2]:
            if leg.mirror is None:
                hidden |= _hidden(points, antenna, azimuth, state.ray_scene)
        return self._as_seen(route, paths.take(~hidden), ends)

    def _as_seen(self, route: _Route, paths: SurfacePaths, ends: Sequence[Vectors]) -> SurfacePaths:
        """Return paths weighted with the mirrors of their legs, their points where the antenna sees them."""
        (first, gain), (last, back_gain) = (
            self._seen_in(leg, points, end)
            for leg, points, end in zip(route.legs, (paths.first, paths.last), ends, strict=True)
        )
        return SurfacePaths(
            first=first,
            last=first if _one_way(route, paths) else last,
            path_m=paths.path_m,
            amplitude=paths.amplitude * (route.ways * gain * back_gain),
        )

    def _seen_in(self, leg: _Leg, points: Vectors, end: Vectors) -> tuple[Vectors, NDArray | float]:
        """Return where the antenna sees points (S, 3) by a leg [m], and the amplitude factor of the leg."""
        if leg.mirror is None or self._mirrors is None:
            return points, 1.0
        return leg.mirror.image(points), self._mirrors.coefficient(leg.mirror, end, points)

    def _range_sums(
        self, paths: SurfacePaths, poses: AzimuthPoses, azimuth: int, *, weighted: bool
    ) -> _RangeSums:
        """Return the sum over paths by range, `weighted` with the azimuth pattern or as if on boresight."""
        gain = self._amplitude_gain(paths.first, poses, azimuth, weighted=weighted)
        same = paths.last is paths.first
        back = gain if same else self._amplitude_gain(paths.last, poses, azimuth, weighted=weighted)
        parts = paths.amplitude * (gain * back * self._scale)
        half = paths.path_m / 2
        _, step = np.unique(np.floor(half / self._step_m), return_inverse=True)
        weight = np.maximum(np.abs(parts), 1e-300)
        amplitude = np.bincount(step, parts.real) + 1j * np.bincount(step, parts.imag)
        range_m = np.bincount(step, weight * half) / np.bincount(step, weight)
        return _RangeSums(range_m=range_m, amplitude=amplitude)

    def _amplitude_gain(
        self, points: Vectors, poses: AzimuthPoses, azimuth: int, *, weighted: bool
    ) -> NDArray[np.float64]:
        """Return the one-way amplitude gain (S,) towards points (S, 3) [m], peak about 1."""
        away = points - poses.position[azimuth]
        bearing, elevation = bearing_and_elevation(poses.axes[azimuth], away)
        tilt = math.radians(self._sensor.mount_tilt_deg)
        antenna = self._antenna
        gain = np.sqrt(np.interp(elevation - tilt, antenna.elevation_grid_rad, antenna.elevation_one_way))
        if not weighted:
            return gain
        return gain * self._azimuth_gain(bearing - self._azimuth_rad[azimuth]) ** 0.25

    def _azimuth_gain(self, offset_rad: NDArray | float) -> NDArray[np.float64]:
        """Return the two-way azimuth power gain at offsets [rad]."""
        antenna = self._antenna
        return np.interp(principal_angle(offset_rad), antenna.azimuth_grid_rad, antenna.azimuth_two_way)

    def _beam_echoes(
        self, sums: _RangeSums, number: int, route: _Route, reference: int, azimuth: int, *, sidelobe: bool
    ) -> BeamEchoes:
        """Return the echoes of one azimuth from a sum computed at the antenna position of `reference`."""
        farther = float(route.range_m[azimuth] - route.range_m[reference])
        closing_mps = float(route.closing_mps[azimuth])
        cycles = 2 * farther / self._sensor.wavelength_m
        amplitude = sums.amplitude * np.exp(-2j * math.pi * (cycles - math.floor(cycles)))
        power = np.square(amplitude.real) + np.square(amplitude.imag)
        range_m = sums.range_m + farther + closing_mps * self._shift_s[azimuth]
        keep = (power > self._floor_w) & (range_m > 0) & (range_m < self._sensor.range_m * 1.02)
        count = int(keep.sum())
        return BeamEchoes(
            azimuth=np.full(count, azimuth, np.int32),
            range_m=range_m[keep],
            amplitude=amplitude[keep].astype(np.complex64),
            mean_power=power[keep].astype(np.float32),
            source=np.full(count, number, np.uint32),
            sidelobe=np.full(count, sidelobe),
            closing_mps=np.full(count, closing_mps, np.float32),
        )


def _lever_m(route: _Route, range_m: float) -> float:
    """Return the size over which phases differ when the antenna moves across the line of sight [m].

    The specular point of a curved target moves with the antenna; along an upright cylinder, which the antenna
    moves past, phases differ by the slant to its ends alone.
    """
    target = route.target
    if KINDS[target.kind].flat or target.kind == "point":
        return target.reach_m
    along_m = target.size_m[1] ** 2 / (2 * range_m) if target.kind == "cylinder" else 0.0
    return along_m + (target.size_m[0] if route.ways > 1 else 0.0)


def _by_nearest(known: NDArray[np.int64], values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return values at 0, 1 ... count - 1, each that at the nearest `known` place."""
    place = np.arange(count)
    after = np.clip(np.searchsorted(known, place), 0, len(known) - 1)
    before = np.maximum(after - 1, 0)
    return values[np.where(np.abs(known[before] - place) <= np.abs(known[after] - place), before, after)]


def _one_way(route: _Route, paths: SurfacePaths) -> bool:
    """Whether all paths return as they came."""
    return route.out is route.back and paths.last is paths.first


def _hidden(points: Vectors, antenna: Vectors, azimuth: int, ray_scene: RayScene) -> NDArray[np.bool_]:
    """Return whether anything stands between points (S, 3) on a target and the antenna (3,) [m]."""
    away = antenna - points
    length = np.linalg.norm(away, axis=1)
    direction = away / length[:, None]
    start = points + direction * _SKIN_M
    hidden = ray_scene.occluded(
        mi.Point3d(np.ascontiguousarray(start.T)),
        mi.Vector3d(np.ascontiguousarray(direction.T)),
        dr.full(mi.UInt32, azimuth, len(points)),
        mi.Float((length - _SKIN_M).astype(np.float32)),
        dr.full(mi.Bool, True, len(points)),
    )
    return hidden.numpy()
