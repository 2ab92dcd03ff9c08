"""The azimuths that receive a return: gain of the beam, range and phase at the pose of each, Doppler shift.

A return found by a ray of one azimuth is received by all azimuths whose beam covers it. Range and phase are
computed from the antenna position of each; the motion of the object between azimuths shifts its range.

Azimuths belong to one scan. Across the seam between its last and its first azimuth lie directions that are
just as near, though measured almost a revolution apart. There the main lobe of an azimuth receives what rays
of its own side of the seam found, at its own time. Its sidelobes receive what rays of the other side found,
at the range from the antenna position of the azimuth and with the phase that they would have had if the scan
had continued (so that the paths of a corner stay in phase). Of motion in the meantime this takes into account
the radial part only, and occlusion is as it was at the time of the ray.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.numerics.decibels import power_ratio
from echoscape.sim.raytracing.bounces import RayReturns, ReturnPaths, picked
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.raytracing.scan_state import PoseTables
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.sensor import Sensor

MAIN_AZIMUTHS = 3
"""Azimuths to each side that belong to the main lobe (2.7 deg, -28 dB two-way); beyond lie sidelobes."""
_LEVELS = 256
_LEVEL_DB = 0.5


@dataclass(frozen=True, kw_only=True)
class BeamEchoes:
    """The E echoes of one group of return paths as NumPy arrays.

    Attributes:
        azimuth: As in `sim.echoes.Echoes` (E,) int32; so are `range_m` float64, `amplitude` complex64,
            `mean_power` float32, `sidelobe` bool and `closing_mps` float32.
        source: Index into the return paths of the group (E,) uint32.
    """

    azimuth: NDArray[np.int32]
    range_m: NDArray[np.float64]
    amplitude: NDArray[np.complex64]
    mean_power: NDArray[np.float32]
    source: NDArray[np.uint32]
    sidelobe: NDArray[np.bool_]
    closing_mps: NDArray[np.float32]


class BeamWeighting:
    """Weights return paths with the azimuth pattern of every azimuth that receives them."""

    def __init__(self, sensor: Sensor, antenna: Antenna, *, floor_w: float) -> None:
        """Tabulate the azimuth pattern.

        Args:
            sensor: The radar.
            antenna: Its patterns.
            floor_w: Mean power below which echoes are left out [W].
        """
        self._sensor = sensor
        self._floor_w = floor_w
        self._table = mi.Float(antenna.azimuth_two_way.astype(np.float32))
        self._steps = len(antenna.azimuth_two_way) - 1
        self._shift_s = sensor.doppler_shift_s
        self._shift_table = mi.Float(self._shift_s.astype(np.float32))
        self._reach_azimuths = self._azimuths_by_level(antenna)

    def _azimuths_by_level(self, antenna: Antenna) -> NDArray[np.int64]:
        """Return how many azimuths to each side receive a return, by its level above the floor."""
        # A return lies up to half an azimuth from the azimuth that points at it.
        most = (self._sensor.azimuths - 1) // 2  # the whole revolution, no azimuth twice
        offset = np.maximum(np.arange(most + 1) - 0.5, 0) * self._sensor.azimuth_step_rad
        gain = np.interp(offset, antenna.azimuth_grid_rad, antenna.azimuth_two_way)
        level = power_ratio(np.arange(_LEVELS) * _LEVEL_DB)
        return np.array([np.flatnonzero(gain * each >= 1).max(initial=0) for each in level])

    def largest_loop_gain(self, paths: RayReturns, azimuth: "mi.UInt32", poses: PoseTables) -> "mi.Float":
        """Return the largest azimuth gain that any azimuth can have for paths that leave and return apart.

        Args:
            paths: What rays return (N).
            azimuth: Azimuth of each ray (N).
            poses: The antenna in the scan.

        Returns:
            Two-way azimuth power gains (N), peak about 1.
        """
        position = dr.gather(mi.Vector3d, poses.position, azimuth)
        out, back = mi.Vector3f(paths.out - position), mi.Vector3f(paths.back - position)
        angle = dr.abs(dr.atan2(out.x * back.y - out.y * back.x, out.x * back.x + out.y * back.y))
        # The product of both gains is largest half way between, or at either when they are far apart.
        return dr.maximum(self._gain_at(angle / 2), dr.sqrt(self._gain_at(angle)))

    def echoes(self, paths: ReturnPaths, poses: PoseTables) -> tuple[ReturnPaths, BeamEchoes] | None:
        """Return the echoes of return paths in all azimuths that receive them.

        Args:
            paths: Return paths (N).
            poses: The antenna in the scan.

        Returns:
            The paths above the floor, and their echoes; None where there are none.
        """
        dr.eval(paths)
        index = dr.compress(paths.power > self._floor_w)
        if len(index) == 0:
            return None
        kept = picked(paths, index)
        middle = self._nearest_azimuth(kept, poses)
        level = dr.log(kept.power * (1 / self._floor_w)) * (10 / math.log(10) / _LEVEL_DB)
        dr.eval(kept, middle, level)
        reach = self._reach_azimuths[np.minimum(level.numpy().astype(np.int64) + 1, _LEVELS - 1)]
        counts = 2 * reach + 1
        source = np.repeat(np.arange(len(counts), dtype=np.uint32), counts)
        starts = np.cumsum(counts) - counts + reach
        offset = (np.arange(len(source)) - starts[source]).astype(np.int32)
        return kept, self._spread(kept, poses, middle, mi.UInt32(source), offset)

    def _off_boresight(self, towards: "mi.Vector3f", azimuth: "mi.UInt32", poses: PoseTables) -> "mi.Float":
        """Return how far directions (N) lie to the right of the beam, -0.5 to 0.5 [revolutions]."""
        beam = mi.Float(azimuth) * self._sensor.azimuth_step_rad + self._sensor.first_azimuth_rad
        offset = (poses.bearing(towards, azimuth) - beam) * (1 / (2 * math.pi))
        return offset - dr.round(offset)

    def _azimuth_gain(self, offset: "mi.Float") -> "mi.Float":
        """Return the two-way azimuth gain, peak about 1, at offsets (N) of -0.5 to 0.5 [revolutions]."""
        step = (offset + 0.5) * self._steps
        index = dr.clip(mi.UInt32(step), 0, self._steps - 1)
        low, high = (dr.gather(mi.Float, self._table, index + k) for k in (0, 1))
        return dr.lerp(low, high, step - mi.Float(index))

    def _gain_at(self, offset: "mi.Float") -> "mi.Float":
        """Return the two-way azimuth gain at an offset of 0 to pi [rad], to the nearest step."""
        step = (offset * (1 / (2 * math.pi)) + 0.5) * self._steps
        return dr.gather(mi.Float, self._table, dr.minimum(mi.UInt32(step + 0.5), self._steps))

    def _nearest_azimuth(self, paths: ReturnPaths, poses: PoseTables) -> "mi.Int32":
        """Return the azimuth whose beam points nearest to the first leg, by the pose of the ray's azimuth.

        Counted from the azimuth of the ray: below 0 or beyond the last azimuth where the first leg lies
        across the seam between the end of the scan and its start.
        """
        position = dr.gather(mi.Vector3d, poses.position, paths.azimuth)
        towards = mi.Vector3f(paths.out - position)
        bearing = poses.bearing(towards, paths.azimuth) - self._sensor.first_azimuth_rad
        away = bearing / (2 * math.pi) - mi.Float(paths.azimuth) * (1 / self._sensor.azimuths)
        return mi.Int32(paths.azimuth) + mi.Int32(dr.round((away - dr.round(away)) * self._sensor.azimuths))

    def _spread(
        self,
        paths: ReturnPaths,
        poses: PoseTables,
        middle: "mi.Int32",
        source: "mi.UInt32",
        offset: NDArray[np.int32],
    ) -> BeamEchoes:
        """Return the echoes of `paths[source]` in the azimuths `offset` (N,) away from the nearest one."""
        azimuths = self._sensor.azimuths
        unwrapped = dr.gather(mi.Int32, middle, source) + mi.Int32(offset)
        azimuth = mi.UInt32((unwrapped + azimuths) % azimuths)
        path = picked(paths, source)
        position = mi.Point3d(dr.gather(mi.Vector3d, poses.position, azimuth))
        out_m, out32 = _length_and_direction(path.out - position)
        off_boresight = self._off_boresight(out32, azimuth, poses)
        counts = self._counts(unwrapped, azimuth, off_boresight)
        gain = self._azimuth_gain(off_boresight)
        if paths.back is paths.out:
            half, mean32 = out_m, out32
        else:
            back_m, back32 = _length_and_direction(path.back - position)
            gain = dr.sqrt(gain * self._azimuth_gain(self._off_boresight(back32, azimuth, poses)))
            half, mean32 = (out_m + back_m) * 0.5, (out32 + back32) * 0.5
        power = path.power * gain
        later = (mi.Float(azimuth) - mi.Float(path.azimuth)) * poses.azimuth_period_s
        half += mi.Float64(path.drift * later)
        closing = dr.dot(dr.gather(mi.Vector3f, poses.velocity, azimuth), mean32) - path.drift
        apparent = half + mi.Float64(closing * self._range_shift(azimuth))
        in_range = (apparent > 0) & (apparent < self._sensor.range_m * 1.02)
        received = counts & (power > self._floor_w) & in_range
        # Across the seam phases are those of a scan that continues, so that paths in phase stay so.
        ahead = (mi.Float(azimuth) - mi.Float(unwrapped)) * poses.azimuth_period_s
        real, imag = self._phased(half + mi.Float64(closing * ahead + path.beyond), dr.sqrt(power), path)
        results = [mi.Int32(azimuth), apparent, real, imag, power, source, closing, mi.Int32(offset)]
        dr.eval(received, *results)
        keep = dr.compress(received)
        results = [dr.gather(type(array), array, keep) for array in results]
        dr.eval(*results)
        azimuth_, range_m, re, im, mean, origin, speed, offset = (array.numpy() for array in results)
        amplitude = np.empty(len(azimuth_), np.complex64)
        amplitude.real, amplitude.imag = re, im
        return BeamEchoes(
            azimuth=azimuth_,
            range_m=range_m,
            amplitude=amplitude,
            mean_power=mean,
            source=origin,
            sidelobe=np.abs(offset) > MAIN_AZIMUTHS,
            closing_mps=speed,
        )

    def _counts(self, unwrapped: "mi.Int32", azimuth: "mi.UInt32", off_boresight: "mi.Float") -> "mi.Bool":
        """Return whether paths count in `azimuth`, whose number before wrapping is `unwrapped` (N).

        Numbers below 0 or beyond the last azimuth lie across the seam. Rays of both sides reach across it, so
        each direction counts in an azimuth from one side only: within the main lobe, and where it lies on
        the azimuth's side of the seam, from that side; otherwise from the other.
        """
        azimuths = self._sensor.azimuths
        offset = off_boresight * azimuths
        points_at = mi.Float(azimuth) + offset
        across = (points_at < -0.5) | (points_at >= azimuths - 0.5)
        other_side = across & (dr.abs(offset) > MAIN_AZIMUTHS + 0.5)
        found_here = (unwrapped >= 0) & (unwrapped < azimuths)
        return found_here ^ other_side

    def _range_shift(self, azimuth: "mi.UInt32") -> "mi.Float | float":
        """Return the range shift per closing speed of each azimuth [m per m/s]."""
        if (self._shift_s == self._shift_s[0]).all():
            return float(self._shift_s[0])
        return dr.gather(mi.Float, self._shift_table, azimuth)

    def _phased(self, half: "mi.Float64", size: "mi.Float", path: ReturnPaths) -> "tuple[mi.Float, mi.Float]":
        """Return real and imaginary part of an amplitude with the phase of the carrier, -4 pi r / lambda."""
        cycles = half * (2 / self._sensor.wavelength_m)
        phase = mi.Float(cycles - dr.floor(cycles)) * (-2 * math.pi)
        sine, cosine = dr.sincos(phase)
        return size * (path.real * cosine - path.imag * sine), size * (path.real * sine + path.imag * cosine)


def _length_and_direction(vector: "mi.Vector3d") -> "tuple[mi.Float64, mi.Vector3f]":
    """Return the length (double) and the unit vector (single) of vectors."""
    length = dr.norm(vector)
    return length, mi.Vector3f(vector) * mi.Float(1 / length)
