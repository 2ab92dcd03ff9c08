"""The echoes of coherent test targets in the azimuths that receive them, beside those that rays find.

Each target is summed over its surface (`sim.raytracing.physical_optics`) from where the antenna is when the
beam passes it, and again whenever the antenna has moved enough to change the phases of the sum; hidden paths
are left out. The sum is kept apart in range, in steps well below the resolution: a long slanting target is
spread in range, while the bounces of a corner, all as long as the path to its apex, add up there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.attitude import bearing_and_elevation
from echoscape.scenes.core.materials import MATERIAL_NAMES, MATERIALS
from echoscape.scenes.core.targets import PlacedTarget, Target
from echoscape.sim.echoes import Returns
from echoscape.sim.kinematics.rolling_scan import AzimuthPoses
from echoscape.sim.numerics.angles import principal_angle
from echoscape.sim.raytracing.beam_weighting import MAIN_AZIMUTHS, BeamEchoes
from echoscape.sim.raytracing.intersection import RayScene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.physical_optics import SurfacePaths, Vectors, surface_paths
from echoscape.sim.raytracing.scan_state import ScanState
from echoscape.sim.raytracing.surface.fresnel import permittivity
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.link_budget import link_w_m2
from echoscape.sim.sensor.sensor import Sensor

_SKIN_M = 5e-3
_STEPS_PER_RESOLUTION = 8
_MOST_PHASE = 0.1
"""Change of phase over a target [cycles] after which its sum is computed again."""


@dataclass(frozen=True, kw_only=True)
class _View:
    """A target as seen from the antenna at each azimuth (A,) of a scan.

    range_m of its reference point, offset_rad of this point from the beam, closing_mps.
    """

    range_m: NDArray[np.float64]
    offset_rad: NDArray[np.float64]
    closing_mps: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class _RangeSums:
    """A sum kept apart in range: half the path range_m (K,) [m], amplitude (K,) complex128 [sqrt(W)]."""

    range_m: NDArray[np.float64]
    amplitude: NDArray[np.complex128]


class TargetEchoes:
    """Computes the echoes of the coherent targets of a scene."""

    def __init__(
        self,
        targets: Sequence[PlacedTarget],
        sensor: Sensor,
        antenna: Antenna,
        *,
        floor_w: float,
    ) -> None:
        """Take the targets.

        Args:
            targets: Targets of the scene; those that are not coherent are left to the rays.
            sensor: The radar.
            antenna: Its patterns.
            floor_w: Power below which echoes are left out [W].
        """
        self._placed = [each for each in targets if each.target.coherent]
        self._sensor, self._antenna, self._floor_w = sensor, antenna, floor_w
        self._scale = math.sqrt(link_w_m2(sensor)) / sensor.wavelength_m
        self._shift_s = sensor.doppler_shift_s
        self._step_m = sensor.resolution_m / _STEPS_PER_RESOLUTION
        self._azimuth_rad = sensor.azimuth_rad

    @property
    def instances(self) -> list[int]:
        """Instance ids of the coherent targets."""
        return [each.instance for each in self._placed]

    def echoes(self, state: ScanState) -> tuple[Returns, BeamEchoes] | None:
        """Return the echoes of the coherent targets in a scan.

        Args:
            state: The scan.

        Returns:
            The targets as return paths, and their echoes; None where nothing is received.
        """
        parts = [
            echoes
            for number, placed in enumerate(self._placed)
            for echoes in self._echoes_of(placed.target, number, state)
        ]
        if not parts:
            return None
        count = len(self._placed)
        instance = np.array(self.instances, np.uint32)
        returns = Returns(
            bounces=np.ones(count, np.uint8),
            instance=instance,
            material=np.array(
                [MATERIAL_NAMES.index(each.target.material) for each in self._placed], np.uint8
            ),
            moving=np.zeros(count, np.bool_),
            surfaces=instance[:, None],
            coherent=np.ones(count, np.bool_),
            displaced=np.zeros(count, np.bool_),
        )
        names = [field.name for field in fields(BeamEchoes)]
        return returns, BeamEchoes(**{k: np.concatenate([getattr(each, k) for each in parts]) for k in names})

    def _view(self, target: Target, poses: AzimuthPoses) -> _View:
        away = np.array(target.position_m) - poses.position
        range_m = np.maximum(np.linalg.norm(away, axis=1), 1e-3)
        offset = principal_angle(bearing_and_elevation(poses.axes, away)[0] - self._azimuth_rad)
        closing = np.einsum("ak,ak->a", poses.velocity, away) / range_m
        return _View(range_m=range_m, offset_rad=offset, closing_mps=closing)

    def _echoes_of(self, target: Target, number: int, state: ScanState) -> list[BeamEchoes]:
        """Return the echoes of one target, azimuth by azimuth."""
        poses = state.poses
        view = self._view(target, poses)
        beyond = np.abs(view.offset_rad) - np.arctan(target.reach_m / view.range_m)
        main = beyond <= (MAIN_AZIMUTHS + 0.5) * self._sensor.azimuth_step_rad
        # In a left turn it may lie between the main lobes of the last and the first azimuth.
        main[np.argmin(beyond)] = True
        near, aside = np.flatnonzero(main), np.flatnonzero(~main)
        nearest = near[np.argmin(np.abs(near[None] - aside[:, None]), axis=1)]
        parts, reference, paths = [], -1, None
        for azimuth in near.tolist():
            if paths is None or self._phases_changed(target, view, poses, reference, azimuth):
                reference, paths = azimuth, self._visible_paths(target, azimuth, state)
            sums = self._range_sums(paths, poses, azimuth, weighted=True)
            parts.append(self._beam_echoes(sums, number, view, reference, azimuth, sidelobe=False))
            unweighted = self._range_sums(paths, poses, azimuth, weighted=False)
            for side in aside[nearest == azimuth].tolist():
                gain = math.sqrt(self._azimuth_gain(view.offset_rad[side]))
                weighted = replace(unweighted, amplitude=unweighted.amplitude * gain)
                parts.append(self._beam_echoes(weighted, number, view, reference, side, sidelobe=True))
        return [each for each in parts if len(each.azimuth)]

    def _phases_changed(
        self, target: Target, view: _View, poses: AzimuthPoses, reference: int, azimuth: int
    ) -> bool:
        """Whether the antenna moved so far between two azimuths that the phases over the target changed."""
        moved = float(np.linalg.norm(poses.position[azimuth] - poses.position[reference]))
        cycles = 2 * moved * target.reach_m / (view.range_m[azimuth] * self._sensor.wavelength_m)
        return cycles > _MOST_PHASE

    def _visible_paths(self, target: Target, azimuth: int, state: ScanState) -> SurfacePaths:
        """Return the paths over a target that nothing hides from the antenna at an azimuth."""
        antenna = state.poses.position[azimuth]
        epsilon = permittivity(MATERIALS[target.material], self._sensor.carrier_hz)
        paths = surface_paths(target, antenna, wavelength_m=self._sensor.wavelength_m, epsilon=epsilon)
        if len(paths.path_m) == 0:
            return paths
        hidden = _hidden(paths.first, antenna, azimuth, state.ray_scene)
        hidden |= _hidden(paths.last, antenna, azimuth, state.ray_scene)
        return SurfacePaths(
            first=paths.first[~hidden],
            last=paths.last[~hidden],
            path_m=paths.path_m[~hidden],
            amplitude=paths.amplitude[~hidden],
        )

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
        self, sums: _RangeSums, number: int, view: _View, reference: int, azimuth: int, *, sidelobe: bool
    ) -> BeamEchoes:
        """Return the echoes of one azimuth from a sum computed at the antenna position of `reference`."""
        farther = float(view.range_m[azimuth] - view.range_m[reference])
        cycles = 2 * farther / self._sensor.wavelength_m
        amplitude = sums.amplitude * np.exp(-2j * math.pi * (cycles - math.floor(cycles)))
        power = np.square(amplitude.real) + np.square(amplitude.imag)
        range_m = sums.range_m + farther + view.closing_mps[azimuth] * self._shift_s[azimuth]
        keep = (power > self._floor_w) & (range_m > 0) & (range_m < self._sensor.range_m * 1.02)
        count = int(keep.sum())
        return BeamEchoes(
            azimuth=np.full(count, azimuth, np.int32),
            range_m=range_m[keep],
            amplitude=amplitude[keep].astype(np.complex64),
            mean_power=power[keep].astype(np.float32),
            source=np.full(count, number, np.uint32),
            sidelobe=np.full(count, sidelobe),
            closing_mps=np.full(count, view.closing_mps[azimuth], np.float32),
        )


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
