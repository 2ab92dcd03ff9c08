"""The echoes of coherent test targets in the azimuths that receive them, beside those that rays find.

Each route to a target, direct or by way of mirrors (`sim.raytracing.targets.routes`), is summed over its
surface (`sim.raytracing.targets.route_sums`) from where the antenna is when the beam passes it, and again
whenever the antenna has moved enough to change the phases of the sum. Direct and mirrored echoes interfere by
the lengths of their paths, as the two rays over smooth ground do.
"""

import math
from collections.abc import Sequence
from dataclasses import fields

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIAL_NAMES
from echoscape.scenes.core.targets import PlacedTarget
from echoscape.sim.echoes import Returns
from echoscape.sim.kinematics.rolling_scan import AzimuthPoses
from echoscape.sim.raytracing.beam_weighting import BeamEchoes
from echoscape.sim.raytracing.displacement import displaced, tolerance
from echoscape.sim.raytracing.scan_state import ScanState
from echoscape.sim.raytracing.targets.mirror_faces import MirrorFaces
from echoscape.sim.raytracing.targets.mirrors import specular_points
from echoscape.sim.raytracing.targets.physical_optics import largest_sum
from echoscape.sim.raytracing.targets.route_sums import RangeSums, RouteSums, amplitude_scale, azimuth_gain
from echoscape.sim.raytracing.targets.routes import Route, RouteSearch
from echoscape.sim.raytracing.targets.surface_paths import SurfacePaths
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.surfaces import SurfaceSettings

_FAINT = 0.01
"""Routes by way of mirrors are left where their power at its largest is below this share of the floor."""
_BOUND_SLACK = 2.0
"""Power of an echo over the estimate of its largest power, at most: beams are not quite even."""


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
        self._search = RouteSearch(self._placed, sensor, mirrors=mirrors)
        self._sums = RouteSums(sensor, antenna, surfaces=surfaces)
        self._scale = amplitude_scale(sensor)
        self._shift_s = sensor.doppler_shift_s
        self._tolerance = tolerance(sensor, antenna)
        pattern, right = antenna.azimuth_two_way, antenna.azimuth_grid_rad >= 0
        largest = np.maximum.accumulate(np.maximum(pattern, pattern[::-1])[right][::-1])[::-1]
        self._largest_gains = antenna.azimuth_grid_rad[right], largest

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
        routes = self._search.routes(state, max_bounces)
        parts = [
            echoes for number, route in enumerate(routes) for echoes in self._echoes_of(route, number, state)
        ]
        if not parts:
            return None
        names = [field.name for field in fields(BeamEchoes)]
        joined = {name: np.concatenate([getattr(each, name) for each in parts]) for name in names}
        return self._returns(routes, state.poses), BeamEchoes(**joined)

    def _returns(self, routes: Sequence[Route], poses: AzimuthPoses) -> Returns:
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

    def _displaced(self, route: Route, poses: AzimuthPoses) -> bool:
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

    def _echoes_of(self, route: Route, number: int, state: ScanState) -> list[BeamEchoes]:
        """Return the echoes of one route, azimuth by azimuth."""
        covered = [leg.main for leg in route.legs]
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
            paths = self._sums.visible_paths(route, reference, state)
            if self._faint(route, paths, reference, state):
                return []
        for azimuth in near.tolist():
            if paths is None or self._sums.phases_changed(route, state.poses, reference, azimuth):
                reference, paths = azimuth, self._sums.visible_paths(route, azimuth, state)
            if len(paths.path_m) == 0:
                continue
            share = float(route.share[azimuth])
            sums = self._sums.range_sums(paths, state.poses, azimuth, weighted=True).scaled(share)
            parts.append(
                self._beam_echoes(sums, number, route, reference, azimuth, sidelobe=bool(sidelobe[azimuth]))
            )
            sides = aside[nearest == azimuth]
            if len(sides) == 0:
                continue
            sums = self._sums.range_sums(paths, state.poses, azimuth, weighted=False).scaled(share)
            for side in sides[sums.largest_w * gain[sides] > self._floor_w / _BOUND_SLACK].tolist():
                weighted = sums.scaled(math.sqrt(gain[side]))
                parts.append(self._beam_echoes(weighted, number, route, reference, side, sidelobe=True))
        return [each for each in parts if len(each.azimuth)]

    def _faint(self, route: Route, paths: SurfacePaths, azimuth: int, state: ScanState) -> bool:
        """Whether a route stays far below the floor, by its paths at the azimuth that covers it best."""
        if len(paths.path_m) == 0:  # something may just pass by
            return False
        sums = self._sums.range_sums(paths, state.poses, azimuth, weighted=True)
        return sums.scaled(float(route.share[azimuth])).largest_w < self._floor_w * _FAINT

    def _route_gain(self, route: Route) -> NDArray[np.float64]:
        """Return the two-way azimuth power gain of a route to its reference point (A,)."""
        if route.out is route.back:
            return azimuth_gain(self._antenna, route.out.offset_rad)
        return np.sqrt(
            azimuth_gain(self._antenna, route.out.offset_rad)
            * azimuth_gain(self._antenna, route.back.offset_rad)
        )

    def _loud(
        self, route: Route, azimuth: NDArray[np.int64], reference: NDArray[np.int64]
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

    def _beam_echoes(
        self, sums: RangeSums, number: int, route: Route, reference: int, azimuth: int, *, sidelobe: bool
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
