"""Which rows hear a return, how loud, from how far: the beam, the path at that row's pose, and Doppler.

A return found by a ray of one row is heard by all rows whose beam covers it. Range and phase are computed
from each row's own position; a thing's own motion between the rows shifts its range.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.antenna import Antenna
from echoscape.sim.backend import dr, mi
from echoscape.sim.motion import RowPoses
from echoscape.sim.paths import ReturnPaths, picked
from echoscape.sim.sensor import Sensor

MAIN_ROWS = 3
"""Rows to each side that belong to the main lobe (2.7 deg, -28 dB two-way); beyond them lie sidelobes."""
SIDE_ROWS = 30
"""Rows to each side up to which sidelobes of strong returns are heard."""


@dataclass(frozen=True, kw_only=True)
class Heard:
    """Echoes of one group of returns as NumPy arrays; see `Echoes` for their meaning."""

    row: NDArray[np.int32]
    range_m: NDArray[np.float64]
    amplitude: NDArray[np.complex64]
    mean_power: NDArray[np.float32]
    source: NDArray[np.uint32]
    sidelobe: NDArray[np.bool_]
    closing_mps: NDArray[np.float32]


class Hearing:
    """Spreads return paths over the rows that hear them."""

    def __init__(self, sensor: Sensor, antenna: Antenna, *, floor_w: float, doppler: bool) -> None:
        self._sensor = sensor
        self._floor_w = floor_w
        self._table = mi.Float(antenna.azimuth_two_way.astype(np.float32))
        self._steps = len(antenna.azimuth_two_way) - 1
        self._shift_s = sensor.doppler_sign * sensor.doppler_beta_s if doppler else 0.0
        spacing = 2 * math.pi / sensor.azimuths
        beyond = np.abs(antenna.azimuth_grid_rad) > (MAIN_ROWS + 0.5) * spacing
        self._side_gain = float(antenna.azimuth_two_way[beyond].max())

    def place(self, poses: RowPoses) -> None:
        """Take the antenna's poses of a scan."""
        self._position = mi.Float64(poses.position.ravel())
        self._velocity = mi.Float(poses.velocity.astype(np.float32).ravel())
        self._yaw = mi.Float(((poses.yaw + math.pi) % (2 * math.pi) - math.pi).astype(np.float32))
        # The time between two rows enters only through the movers' own motion.
        self._row_s = dr.opaque(mi.Float, self._sensor.row_s)

    def _azimuth_gain(self, towards: "mi.Vector3f", row: "mi.UInt32", active: "mi.Bool") -> "mi.Float":
        """Return the two-way azimuth gain (peak about 1) of a row's beam towards directions (N)."""
        spacing = 2 * math.pi / self._sensor.azimuths
        heading = dr.gather(mi.Float, self._yaw, row, active) - mi.Float(row) * spacing
        offset = heading - dr.atan2(towards.y, towards.x)
        turns = offset * (1 / (2 * math.pi))
        place = (turns - dr.round(turns) + 0.5) * self._steps
        index = dr.clip(mi.UInt32(place), 0, self._steps - 1)
        low, high = (dr.gather(mi.Float, self._table, index + k, active) for k in (0, 1))
        return dr.lerp(low, high, place - mi.Float(index))

    def loop_gain(self, paths: ReturnPaths) -> "mi.Float":
        """Return the best azimuth gain that any row could have for paths that leave and come back apart."""
        position = dr.gather(mi.Vector3d, self._position, paths.row)
        out, back = mi.Vector3f(paths.out - position), mi.Vector3f(paths.back - position)
        turn = dr.atan2(out.x * back.y - out.y * back.x, out.x * back.x + out.y * back.y)
        # The product of both gains is largest half way between, or at either when they are far apart.
        at = lambda angle: dr.gather(  # noqa: E731
            mi.Float, self._table, mi.UInt32((dr.clip(dr.abs(angle) / (2 * math.pi), 0, 0.5) + 0.5) * self._steps)
        )
        return dr.maximum(at(turn / 2), dr.sqrt(at(turn)))

    def hear(self, paths: ReturnPaths) -> list[tuple[ReturnPaths, Heard]]:
        """Return the echoes of `paths` in the main lobe, and those of strong ones in the sidelobes."""
        kept = picked(paths, dr.compress(paths.power > self._floor_w))
        if dr.width(kept.row) == 0:
            return []
        dr.eval(kept)
        near = list(range(-MAIN_ROWS, MAIN_ROWS + 1))
        found = [(kept, self._spread(kept, near, sidelobe=False))]
        strong = picked(kept, dr.compress(kept.power * self._side_gain > self._floor_w))
        if dr.width(strong.row):
            far = [k for k in range(-SIDE_ROWS, SIDE_ROWS + 1) if abs(k) > MAIN_ROWS]
            found.append((strong, self._spread(strong, far, sidelobe=True)))
        return found

    def _middle_row(self, paths: ReturnPaths) -> "mi.Float":
        """Return the row whose beam points nearest to where the path leaves (its home row's pose will do)."""
        position = dr.gather(mi.Vector3d, self._position, paths.row)
        towards = mi.Vector3f(paths.out - position)
        turns = (dr.gather(mi.Float, self._yaw, paths.row) - dr.atan2(towards.y, towards.x)) / (2 * math.pi)
        return dr.round((turns - dr.floor(turns)) * self._sensor.azimuths)

    def _spread(self, paths: ReturnPaths, offsets: list[int], *, sidelobe: bool) -> Heard:
        """Return the echoes of `paths` in the rows at `offsets` from the row that points at each."""
        azimuths = self._sensor.azimuths
        middle = mi.Int32(self._middle_row(paths))
        lane = dr.arange(mi.UInt32, dr.width(paths.row) * len(offsets))
        source = lane // len(offsets)
        offset = dr.gather(mi.Int32, mi.Int32(offsets), lane - source * len(offsets))
        row = mi.UInt32((dr.gather(mi.Int32, middle, source) + offset + azimuths) % azimuths)
        path = picked(paths, source)
        position = mi.Point3d(dr.gather(mi.Vector3d, self._position, row))
        out, back = path.out - position, path.back - position
        out_m, back_m = dr.norm(out), dr.norm(back)
        out32, back32 = mi.Vector3f(out / out_m), mi.Vector3f(back / back_m)
        both = self._azimuth_gain(out32, row, True) * self._azimuth_gain(back32, row, True)
        power = path.power * dr.sqrt(both)
        later = (mi.Float(row) - mi.Float(path.row)) * self._row_s
        half = (out_m + back_m) * 0.5 + mi.Float64(path.drift * later)
        velocity = dr.gather(mi.Vector3f, self._velocity, row)
        closing = dr.dot(velocity, (out32 + back32) * 0.5) - path.drift
        apparent = half + mi.Float64(closing * self._shift_s)
        heard = dr.compress((power > self._floor_w) & (apparent > 0) & (apparent < self._sensor.range_m * 1.02))
        real, imag = self._phased(half, dr.sqrt(power), path)
        results = [dr.gather(type(a), a, heard) for a in (row, apparent, real, imag, power, source, closing)]
        dr.eval(*results)
        row_, range_m, re, im, mean, origin, speed = (array.numpy() for array in results)
        amplitude = np.empty(len(row_), np.complex64)
        amplitude.real, amplitude.imag = re, im
        return Heard(
            row=row_.astype(np.int32),
            range_m=range_m,
            amplitude=amplitude,
            mean_power=mean,
            source=origin,
            sidelobe=np.full(len(row_), sidelobe),
            closing_mps=speed,
        )

    def _phased(self, half: "mi.Float64", size: "mi.Float", path: ReturnPaths) -> "tuple[mi.Float, mi.Float]":
        """Return real and imaginary part of an amplitude after the carrier's phase -4 pi r / lambda."""
        cycles = half * (2 / self._sensor.wavelength_m)
        phase = mi.Float(cycles - dr.floor(cycles)) * (-2 * math.pi)
        sine, cosine = dr.sincos(phase)
        return size * (path.real * cosine - path.imag * sine), size * (path.real * sine + path.imag * cosine)
