"""Which rows hear a return, how loud, from how far: the beam, the path at that row's pose, and Doppler.

A return found by a ray of one row is heard by all rows whose beam covers it. Range and phase are computed
from each row's own position; a thing's own motion between the rows shifts its range.

Rows are of one turn: across the seam between the last and the first row lie directions that are as near, at
times almost a turn apart. What a row's main lobe hears there, rays of its own side of the seam found, at its
own time; its sidelobes hear what rays of the other side found, as far as it is from where the row's antenna
is, with the phase that it would have had the turn gone on (so that the paths of a corner stay in step). Of
what moved meanwhile, that takes the radial motion alone; what it hides by then is as it was.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.kinematics.rolling_scan import AzimuthPoses
from echoscape.sim.numerics.decibels import power_ratio
from echoscape.sim.raytracing.bounces import ReturnPaths, picked
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.sensor.antenna import Antenna
from echoscape.sim.sensor.sensor import Sensor

MAIN_ROWS = 3
"""Rows to each side that belong to the main lobe (2.7 deg, -28 dB two-way); beyond them lie sidelobes."""
_LEVELS = 256
_LEVEL_DB = 0.5


@dataclass(frozen=True, kw_only=True)
class BeamEchoes:
    """Echoes of one group of returns as NumPy arrays; see `Echoes` for their meaning."""

    row: NDArray[np.int32]
    range_m: NDArray[np.float64]
    amplitude: NDArray[np.complex64]
    mean_power: NDArray[np.float32]
    source: NDArray[np.uint32]
    sidelobe: NDArray[np.bool_]
    closing_mps: NDArray[np.float32]


class BeamWeighting:
    """Spreads return paths over the rows that hear them."""

    def __init__(self, sensor: Sensor, antenna: Antenna, *, floor_w: float) -> None:
        self._sensor = sensor
        self._floor_w = floor_w
        self._table = mi.Float(antenna.azimuth_two_way.astype(np.float32))
        self._steps = len(antenna.azimuth_two_way) - 1
        self._shift_s = sensor.doppler_shift_s
        self._shift_table = mi.Float(self._shift_s.astype(np.float32))
        self._reach_rows = self._rows_by_level(antenna)

    def _rows_by_level(self, antenna: Antenna) -> NDArray[np.int64]:
        """Return how many rows to each side hear a return that is so many levels above the floor."""
        # A return lies up to half a row from the row that points at it.
        most = (self._sensor.azimuths - 1) // 2  # the whole turn, no row twice
        offset = np.maximum(np.arange(most + 1) - 0.5, 0) * (2 * math.pi / self._sensor.azimuths)
        gain = np.interp(offset, antenna.azimuth_grid_rad, antenna.azimuth_two_way)
        level = power_ratio(np.arange(_LEVELS) * _LEVEL_DB)
        return np.array([np.flatnonzero(gain * each >= 1).max(initial=0) for each in level])

    def place(self, poses: AzimuthPoses) -> None:
        """Take the antenna's poses of a scan."""
        self._position = mi.Float64(poses.position.ravel())
        self._velocity = mi.Float(poses.velocity.astype(np.float32).ravel())
        self._yaw = mi.Float(((poses.yaw + math.pi) % (2 * math.pi) - math.pi).astype(np.float32))
        # The time between two rows enters only through the movers' own motion.
        self._row_s = dr.opaque(mi.Float, poses.azimuth_period_s)

    def _aside(self, towards: "mi.Vector3f", row: "mi.UInt32") -> "mi.Float":
        """Return how far directions (N) lie to the right of a row's beam, -0.5 to 0.5 [turns]."""
        spacing = 2 * math.pi / self._sensor.azimuths
        heading = dr.gather(mi.Float, self._yaw, row) - mi.Float(row) * spacing
        turns = (heading - dr.atan2(towards.y, towards.x)) * (1 / (2 * math.pi))
        return turns - dr.round(turns)

    def _azimuth_gain(self, aside: "mi.Float") -> "mi.Float":
        """Return the two-way azimuth gain (peak about 1) at offsets (N) of -0.5 to 0.5 [turns]."""
        place = (aside + 0.5) * self._steps
        index = dr.clip(mi.UInt32(place), 0, self._steps - 1)
        low, high = (dr.gather(mi.Float, self._table, index + k) for k in (0, 1))
        return dr.lerp(low, high, place - mi.Float(index))

    def loop_gain(self, paths: ReturnPaths) -> "mi.Float":
        """Return the best azimuth gain that any row could have for paths that leave and come back apart."""
        position = dr.gather(mi.Vector3d, self._position, paths.row)
        out, back = mi.Vector3f(paths.out - position), mi.Vector3f(paths.back - position)
        turn = dr.abs(dr.atan2(out.x * back.y - out.y * back.x, out.x * back.x + out.y * back.y))
        # The product of both gains is largest half way between, or at either when they are far apart.
        return dr.maximum(self._gain_at(turn / 2), dr.sqrt(self._gain_at(turn)))

    def _gain_at(self, offset: "mi.Float") -> "mi.Float":
        """Return the two-way azimuth gain at an offset of 0 to pi [rad], to the nearest step."""
        place = (offset * (1 / (2 * math.pi)) + 0.5) * self._steps
        return dr.gather(mi.Float, self._table, dr.minimum(mi.UInt32(place + 0.5), self._steps))

    def hear(self, paths: ReturnPaths) -> tuple[ReturnPaths, BeamEchoes] | None:
        """Return the paths that are heard at all and their echoes, or None."""
        dr.eval(paths)
        index = dr.compress(paths.power > self._floor_w)
        if len(index) == 0:
            return None
        kept = picked(paths, index)
        middle = self._middle_row(kept)
        level = dr.log(kept.power * (1 / self._floor_w)) * (10 / math.log(10) / _LEVEL_DB)
        dr.eval(kept, middle, level)
        reach = self._reach_rows[np.minimum(level.numpy().astype(np.int64) + 1, _LEVELS - 1)]
        counts = 2 * reach + 1
        source = np.repeat(np.arange(len(counts), dtype=np.uint32), counts)
        starts = np.cumsum(counts) - counts + reach
        offset = (np.arange(len(source)) - starts[source]).astype(np.int32)
        return kept, self._spread(kept, middle, mi.UInt32(source), offset)

    def _middle_row(self, paths: ReturnPaths) -> "mi.Int32":
        """Return the row whose beam points nearest to where the path leaves, by its home row's pose.

        Counted from the home row: below 0 or beyond the last row where the path leaves across the seam
        between the scan's end and its start.
        """
        position = dr.gather(mi.Vector3d, self._position, paths.row)
        towards = mi.Vector3f(paths.out - position)
        turns = (dr.gather(mi.Float, self._yaw, paths.row) - dr.atan2(towards.y, towards.x)) / (2 * math.pi)
        away = turns - mi.Float(paths.row) * (1 / self._sensor.azimuths)
        return mi.Int32(paths.row) + mi.Int32(dr.round((away - dr.round(away)) * self._sensor.azimuths))

    def _spread(
        self, paths: ReturnPaths, middle: "mi.Int32", source: "mi.UInt32", offset: NDArray[np.int32]
    ) -> BeamEchoes:
        """Return the echoes of `paths[source]` in the rows `offset` (N,) away from the one pointing there."""
        azimuths = self._sensor.azimuths
        place = dr.gather(mi.Int32, middle, source) + mi.Int32(offset)
        row = mi.UInt32((place + azimuths) % azimuths)
        path = picked(paths, source)
        position = mi.Point3d(dr.gather(mi.Vector3d, self._position, row))
        out_m, out32 = _length_and_direction(path.out - position)
        aside = self._aside(out32, row)
        whole = self._counts(place, row, aside)
        both = self._azimuth_gain(aside)
        if paths.back is paths.out:
            half, mean32 = out_m, out32
        else:
            back_m, back32 = _length_and_direction(path.back - position)
            both = dr.sqrt(both * self._azimuth_gain(self._aside(back32, row)))
            half, mean32 = (out_m + back_m) * 0.5, (out32 + back32) * 0.5
        power = path.power * both
        later = (mi.Float(row) - mi.Float(path.row)) * self._row_s
        half += mi.Float64(path.drift * later)
        closing = dr.dot(dr.gather(mi.Vector3f, self._velocity, row), mean32) - path.drift
        apparent = half + mi.Float64(closing * self._range_shift(row))
        audible = whole & (power > self._floor_w) & (apparent > 0) & (apparent < self._sensor.range_m * 1.02)
        # Across the seam phases are those of a turn that had gone on, so that what came in step still does.
        ahead = (mi.Float(row) - mi.Float(place)) * self._row_s
        real, imag = self._phased(half + mi.Float64(closing * ahead), dr.sqrt(power), path)
        results = [mi.Int32(row), apparent, real, imag, power, source, closing, mi.Int32(offset)]
        dr.eval(audible, *results)
        keep = dr.compress(audible)
        results = [dr.gather(type(array), array, keep) for array in results]
        dr.eval(*results)
        row_, range_m, re, im, mean, origin, speed, offset = (array.numpy() for array in results)
        amplitude = np.empty(len(row_), np.complex64)
        amplitude.real, amplitude.imag = re, im
        return BeamEchoes(
            row=row_,
            range_m=range_m,
            amplitude=amplitude,
            mean_power=mean,
            source=origin,
            sidelobe=np.abs(offset) > MAIN_ROWS,
            closing_mps=speed,
        )

    def _counts(self, place: "mi.Int32", row: "mi.UInt32", aside: "mi.Float") -> "mi.Bool":
        """Return whether paths found from rows about `place` (N) are what `row`, that place, hears there.

        Places below 0 or beyond the last row lie across the seam. Rays of both sides reach across it, so each
        direction counts for a row from one side only: within the row's main lobe, and where it lies on this
        side of the seam for the row, from this side; else from the other.
        """
        azimuths = self._sensor.azimuths
        rows = aside * azimuths
        points_at = mi.Float(row) + rows
        across = (points_at < -0.5) | (points_at >= azimuths - 0.5)
        other_side = across & (dr.abs(rows) > MAIN_ROWS + 0.5)
        found_here = (place >= 0) & (place < azimuths)
        return found_here ^ other_side

    def _range_shift(self, row: "mi.UInt32") -> "mi.Float | float":
        """Return the range shift by closing speed [s] of each row."""
        if (self._shift_s == self._shift_s[0]).all():
            return float(self._shift_s[0])
        return dr.gather(mi.Float, self._shift_table, row)

    def _phased(self, half: "mi.Float64", size: "mi.Float", path: ReturnPaths) -> "tuple[mi.Float, mi.Float]":
        """Return real and imaginary part of an amplitude after the carrier's phase -4 pi r / lambda."""
        cycles = half * (2 / self._sensor.wavelength_m)
        phase = mi.Float(cycles - dr.floor(cycles)) * (-2 * math.pi)
        sine, cosine = dr.sincos(phase)
        return size * (path.real * cosine - path.imag * sine), size * (path.real * sine + path.imag * cosine)


def _length_and_direction(vector: "mi.Vector3d") -> "tuple[mi.Float64, mi.Vector3f]":
    """Return the length (double) and the unit vector (single) of vectors."""
    length = dr.norm(vector)
    return length, mi.Vector3f(vector) * mi.Float(1 / length)
