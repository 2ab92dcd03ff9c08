"""The phase sum of a route over its target, from where the antenna is, kept apart in range.

The sum is taken over the surface of the target (`sim.raytracing.targets.physical_optics`) and hidden paths
are left out. Steps of range are well below the resolution: a long slanting target is spread in range, while
the bounces of a corner, all as long as the path to its apex, add up there. The antenna's image in a mirror
takes its place in the sum.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.attitude import bearing_and_elevation
from echoscape.scenes.core.materials import MATERIALS
from echoscape.scenes.core.targets import KINDS
from echoscape.sim.kinematics.rolling_scan import AzimuthPoses
from echoscape.sim.numerics.angles import principal_angle
from echoscape.sim.raytracing.intersection import RayScene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.scan_state import ScanState
from echoscape.sim.raytracing.surface.fresnel import permittivity
from echoscape.sim.raytracing.targets.mirrors import MirrorMaterials
from echoscape.sim.raytracing.targets.physical_optics import surface_paths
from echoscape.sim.raytracing.targets.routes import Leg, Route
from echoscape.sim.raytracing.targets.surface_paths import SurfacePaths, Vectors
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


@dataclass(frozen=True, kw_only=True)
class RangeSums:
    """A sum kept apart in range.

    Attributes:
        range_m: Half the length of the paths (K,) float64 [m].
        amplitude: Amplitude (K,) complex128 [sqrt(W)].
    """

    range_m: NDArray[np.float64]
    amplitude: NDArray[np.complex128]

    @property
    def largest_w(self) -> float:
        """Largest power in one step of range [W]."""
        return float(np.max(np.square(np.abs(self.amplitude)), initial=0.0))

    def scaled(self, factor: float) -> "RangeSums":
        """Return the sum times a factor on the amplitude.

        Args:
            factor: The factor.

        Returns:
            The product.
        """
        return replace(self, amplitude=self.amplitude * factor)


class RouteSums:
    """Sums the paths of routes for one radar."""

    def __init__(self, sensor: Sensor, antenna: Antenna, *, surfaces: SurfaceSettings | None = None) -> None:
        """Take the radar.

        Args:
            sensor: The radar.
            antenna: Its patterns.
            surfaces: Changes to the roughness of the mirrors; None is none.
        """
        self._sensor, self._antenna = sensor, antenna
        self._azimuth_rad = sensor.azimuth_rad
        self._step_m = sensor.resolution_m / _STEPS_PER_RESOLUTION
        self._scale = amplitude_scale(sensor)
        self._materials = MirrorMaterials(
            carrier_hz=sensor.carrier_hz, wavelength_m=sensor.wavelength_m, surfaces=surfaces
        )

    def phases_changed(self, route: Route, poses: AzimuthPoses, reference: int, azimuth: int) -> bool:
        """Whether the antenna moved so far between two azimuths that the phases over the target changed.

        Args:
            route: The route.
            poses: Poses of the antenna at every azimuth.
            reference: Azimuth at which the sum was computed.
            azimuth: Azimuth at which it is wanted.

        Returns:
            Whether the sum has to be computed again.
        """
        moved = float(np.linalg.norm(poses.position[azimuth] - poses.position[reference]))
        range_m = min(float(leg.range_m[azimuth]) for leg in route.legs)
        cycles = 2 * moved * _lever_m(route, range_m) / (range_m * self._sensor.wavelength_m)
        return cycles > _MOST_PHASE or moved > _MOST_SHIFT * range_m

    def visible_paths(self, route: Route, azimuth: int, state: ScanState) -> SurfacePaths:
        """Return the paths of a route over its target at an azimuth, with the points where they are seen.

        Of direct legs those are left out that something hides; mirrored ones carry the mirror's coefficient.

        Args:
            route: The route.
            azimuth: The azimuth.
            state: The scan.

        Returns:
            The paths.
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

    def _as_seen(self, route: Route, paths: SurfacePaths, ends: Sequence[Vectors]) -> SurfacePaths:
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

    def _seen_in(self, leg: Leg, points: Vectors, end: Vectors) -> tuple[Vectors, NDArray | float]:
        """Return where the antenna sees points (S, 3) by a leg [m], and the amplitude factor of the leg."""
        if leg.mirror is None:
            return points, 1.0
        return leg.mirror.image(points), self._materials.coefficient(leg.mirror, end, points)

    def range_sums(
        self, paths: SurfacePaths, poses: AzimuthPoses, azimuth: int, *, weighted: bool
    ) -> RangeSums:
        """Return the sum over paths by range.

        Args:
            paths: The paths.
            poses: Poses of the antenna at every azimuth.
            azimuth: The azimuth.
            weighted: Whether with the azimuth pattern, or as if on boresight.

        Returns:
            The sum in each step of range.
        """
        gain = self._amplitude_gain(paths.first, poses, azimuth, weighted=weighted)
        same = paths.last is paths.first
        back = gain if same else self._amplitude_gain(paths.last, poses, azimuth, weighted=weighted)
        parts = paths.amplitude * (gain * back * self._scale)
        half = paths.path_m / 2
        _, step = np.unique(np.floor(half / self._step_m), return_inverse=True)
        weight = np.maximum(np.abs(parts), 1e-300)
        amplitude = np.bincount(step, parts.real) + 1j * np.bincount(step, parts.imag)
        range_m = np.bincount(step, weight * half) / np.bincount(step, weight)
        return RangeSums(range_m=range_m, amplitude=amplitude)

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
        return gain * azimuth_gain(self._antenna, bearing - self._azimuth_rad[azimuth]) ** 0.25


def amplitude_scale(sensor: Sensor) -> float:
    """Return the root of the received power over the sum of a target [sqrt(W)].

    Args:
        sensor: The radar.

    Returns:
        sqrt(link) / lambda.
    """
    return math.sqrt(link_w_m2(sensor)) / sensor.wavelength_m


def azimuth_gain(antenna: Antenna, offset_rad: NDArray | float) -> NDArray[np.float64]:
    """Return the two-way azimuth power gain.

    Args:
        antenna: The patterns.
        offset_rad: Angles from the beam (K,) [rad].

    Returns:
        The gain (K,), peak about 1.
    """
    return np.interp(principal_angle(offset_rad), antenna.azimuth_grid_rad, antenna.azimuth_two_way)


def _lever_m(route: Route, range_m: float) -> float:
    """Return the size over which phases differ when the antenna moves across the line of sight [m].

    The specular point of a curved target moves with the antenna; along an upright cylinder, which the antenna
    moves past, phases differ by the slant to its ends alone.
    """
    target = route.target
    if KINDS[target.kind].flat or target.kind == "point":
        return target.reach_m
    along_m = target.size_m[1] ** 2 / (2 * range_m) if target.kind == "cylinder" else 0.0
    return along_m + (target.size_m[0] if route.ways > 1 else 0.0)


def _one_way(route: Route, paths: SurfacePaths) -> bool:
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
