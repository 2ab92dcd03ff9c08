"""The echoes of coherent test targets in the rows that hear them, beside those that rays find.

Each target is summed over its surface (sim/raytracing/physical_optics.py) from where the radar is when the beam passes it, anew
whenever the radar has moved enough to change the sum's phases; paths that something hides are left out. The
sum is kept apart by range in steps well below the resolution, so that a long slanting target is long in
range too, while a corner's bounces, all as long as the way to its apex, add up there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.materials import MATERIAL_NAMES, MATERIALS
from echoscape.scenes.core.targets import PlacedTarget, Target
from echoscape.sim.echoes import Returns
from echoscape.sim.kinematics.rolling_scan import AzimuthPoses
from echoscape.sim.raytracing.beam_weighting import MAIN_ROWS, BeamEchoes
from echoscape.sim.raytracing.intersection import RayScene
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.physical_optics import Aperture, aperture
from echoscape.sim.raytracing.surface.fresnel import permittivity
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.link_budget import link_w_m2
from echoscape.sim.sensor.sensor import Sensor

_SKIN_M = 5e-3
_STEPS_PER_CELL = 8
_MOST_PHASE = 0.1
"""Change of phase over a target [cycles] after which its sum is taken anew."""


Vectors = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class _View:
    """A target from where the radar is in each row (A,) of a scan.

    range_m, offset_rad: of its reference point, the offset from the row's beam; closing_mps.
    """

    range_m: NDArray[np.float64]
    offset_rad: NDArray[np.float64]
    closing_mps: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class _Slices:
    """A sum kept apart by range: range_m (K,) half the path [m], amplitude (K,) complex128 [sqrt(W)]."""

    range_m: NDArray[np.float64]
    amplitude: NDArray[np.complex128]


class TargetEchoes:
    """Makes the echoes of a town's coherent targets; holds what does not change from scan to scan."""

    def __init__(
        self,
        targets: Sequence[PlacedTarget],
        sensor: Sensor,
        antenna: Antenna,
        *,
        floor_w: float,
    ) -> None:
        self._placed = [each for each in targets if each.target.coherent]
        self._sensor, self._antenna, self._floor_w = sensor, antenna, floor_w
        self._scale = math.sqrt(link_w_m2(sensor)) / sensor.wavelength_m
        self._shift_s = sensor.doppler_shift_s
        self._step_m = sensor.resolution_m / _STEPS_PER_CELL
        self._spacing = 2 * math.pi / sensor.azimuths

    @property
    def instances(self) -> list[int]:
        """Instance ids of the targets."""
        return [each.instance for each in self._placed]

    def hear(self, world: RayScene, poses: AzimuthPoses) -> tuple[Returns, BeamEchoes] | None:
        """Return what the targets send back to the antenna at `poses`, None where nothing is heard."""
        parts = [
            self._rows(placed.target, number, world, poses) for number, placed in enumerate(self._placed)
        ]
        heard = [part for per_target in parts for part in per_target]
        if not heard:
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
        )
        names = [field.name for field in fields(BeamEchoes)]
        return returns, BeamEchoes(**{k: np.concatenate([getattr(each, k) for each in heard]) for k in names})

    def _view(self, target: Target, poses: AzimuthPoses) -> _View:
        away = np.array(target.position_m) - poses.position
        range_m = np.maximum(np.linalg.norm(away, axis=1), 1e-3)
        beam = poses.yaw - self._spacing * np.arange(self._sensor.azimuths)
        offset = np.remainder(beam - np.arctan2(away[:, 1], away[:, 0]) + math.pi, 2 * math.pi) - math.pi
        closing = np.einsum("ak,ak->a", poses.velocity, away) / range_m
        return _View(range_m=range_m, offset_rad=offset, closing_mps=closing)

    def _rows(self, target: Target, number: int, world: RayScene, poses: AzimuthPoses) -> list[BeamEchoes]:
        """Return what each row hears of one target."""
        view = self._view(target, poses)
        beyond = np.abs(view.offset_rad) - np.arctan(target.reach_m / view.range_m)
        main = beyond <= (MAIN_ROWS + 0.5) * self._spacing
        # A turn to the left may leave it between the last row's main lobe and the first one's.
        main[np.argmin(beyond)] = True
        near, aside = np.flatnonzero(main), np.flatnonzero(~main)
        nearest = near[np.argmin(np.abs(near[None] - aside[:, None]), axis=1)]
        heard, knot, paths = [], -1, None
        for row in near.tolist():
            if paths is None or self._changed(target, view, poses, knot, row):
                knot, paths = row, self._seen(target, poses.position[row], row, world)
            slices = self._slices(paths, poses, row, azimuth=True)
            heard.append(self._heard(slices, number, view, knot, row, sidelobe=False))
            plain = self._slices(paths, poses, row, azimuth=False)
            for side in aside[nearest == row].tolist():
                gain = math.sqrt(self._azimuth_gain(view.offset_rad[side]))
                dimmed = replace(plain, amplitude=plain.amplitude * gain)
                heard.append(self._heard(dimmed, number, view, knot, side, sidelobe=True))
        return [each for each in heard if len(each.azimuth)]

    def _changed(self, target: Target, view: _View, poses: AzimuthPoses, knot: int, row: int) -> bool:
        """Whether the radar moved so far between two rows that the phases over the target are others."""
        moved = float(np.linalg.norm(poses.position[row] - poses.position[knot]))
        cycles = 2 * moved * target.reach_m / (view.range_m[row] * self._sensor.wavelength_m)
        return cycles > _MOST_PHASE

    def _seen(self, target: Target, radar: Vectors, row: int, world: RayScene) -> Aperture:
        """Return the paths over a target from `radar` (3,) [m] that nothing hides."""
        epsilon = permittivity(MATERIALS[target.material], self._sensor.carrier_hz)
        paths = aperture(target, radar, wavelength_m=self._sensor.wavelength_m, epsilon=epsilon)
        if len(paths.path_m) == 0:
            return paths
        hidden = _hidden(paths.first, radar, row, world) | _hidden(paths.last, radar, row, world)
        return Aperture(
            first=paths.first[~hidden],
            last=paths.last[~hidden],
            path_m=paths.path_m[~hidden],
            amplitude=paths.amplitude[~hidden],
        )

    def _slices(self, paths: Aperture, poses: AzimuthPoses, row: int, *, azimuth: bool) -> _Slices:
        """Return the sum over paths by range in a row; without `azimuth`, as if it looked straight there."""
        gain = self._amplitude_gain(paths.first, poses, row, azimuth=azimuth)
        back = gain if paths.last is paths.first else None
        back = self._amplitude_gain(paths.last, poses, row, azimuth=azimuth) if back is None else back
        parts = paths.amplitude * (gain * back * self._scale)
        half = paths.path_m / 2
        _, step = np.unique(np.floor(half / self._step_m), return_inverse=True)
        weight = np.maximum(np.abs(parts), 1e-300)
        amplitude = np.bincount(step, parts.real) + 1j * np.bincount(step, parts.imag)
        return _Slices(
            range_m=np.bincount(step, weight * half) / np.bincount(step, weight), amplitude=amplitude
        )

    def _amplitude_gain(
        self, place: Vectors, poses: AzimuthPoses, row: int, *, azimuth: bool
    ) -> NDArray[np.float64]:
        """Return the one-way amplitude gain (S,) of a row towards places (S, 3) [m], peak about 1."""
        away = place - poses.position[row]
        elevation = np.arctan2(away[:, 2], np.hypot(away[:, 0], away[:, 1]))
        tilt = math.radians(self._sensor.mount_tilt_deg)
        antenna = self._antenna
        gain = np.sqrt(np.interp(elevation - tilt, antenna.elevation_grid_rad, antenna.elevation_one_way))
        if not azimuth:
            return gain
        beam = poses.yaw[row] - self._spacing * row
        offset = beam - np.arctan2(away[:, 1], away[:, 0])
        return gain * self._azimuth_gain(offset) ** 0.25

    def _azimuth_gain(self, offset_rad: NDArray | float) -> NDArray[np.float64]:
        """Return the two-way azimuth power gain at offsets [rad]."""
        wrapped = np.remainder(np.asarray(offset_rad) + math.pi, 2 * math.pi) - math.pi
        return np.interp(wrapped, self._antenna.azimuth_grid_rad, self._antenna.azimuth_two_way)

    def _heard(
        self, slices: _Slices, number: int, view: _View, knot: int, row: int, *, sidelobe: bool
    ) -> BeamEchoes:
        """Return the echoes of a row from a sum taken from where the radar was in the row `knot`."""
        farther = float(view.range_m[row] - view.range_m[knot])
        cycles = 2 * farther / self._sensor.wavelength_m
        amplitude = slices.amplitude * np.exp(-2j * math.pi * (cycles - math.floor(cycles)))
        power = np.square(amplitude.real) + np.square(amplitude.imag)
        range_m = slices.range_m + farther + view.closing_mps[row] * self._shift_s[row]
        keep = (power > self._floor_w) & (range_m > 0) & (range_m < self._sensor.range_m * 1.02)
        count = int(keep.sum())
        return BeamEchoes(
            row=np.full(count, row, np.int32),
            range_m=range_m[keep],
            amplitude=amplitude[keep].astype(np.complex64),
            mean_power=power[keep].astype(np.float32),
            source=np.full(count, number, np.uint32),
            sidelobe=np.full(count, sidelobe),
            closing_mps=np.full(count, view.closing_mps[row], np.float32),
        )


def _hidden(place: Vectors, radar: Vectors, row: int, world: RayScene) -> NDArray[np.bool_]:
    """Return whether anything stands between places (S, 3) on a target and the radar (3,) [m]."""
    away = radar - place
    length = np.linalg.norm(away, axis=1)
    way = away / length[:, None]
    start = place + way * _SKIN_M
    blocked = world.blocked(
        mi.Point3d(np.ascontiguousarray(start.T)),
        mi.Vector3d(np.ascontiguousarray(way.T)),
        dr.full(mi.UInt32, row, len(place)),
        mi.Float((length - _SKIN_M).astype(np.float32)),
        dr.full(mi.Bool, True, len(place)),
    )
    return blocked.numpy()
