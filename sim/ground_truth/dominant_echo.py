"""The echoes that dominate each cell of a scan: their power, their kind, and the strongest return.

Echoes are summed by range step and kind once. Results for a cell are kept, since settings of the receiver ask
for the same cells: a pure memo, so that neither order nor number of queries changes a result.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.polar_scan import Component
from echoscape.sim.echoes import Echoes
from echoscape.sim.raytracing.mitsuba_backend import dr, mi
from echoscape.sim.receiver.front_end import PART_STEP
from echoscape.sim.receiver.if_signal import grid_place
from echoscape.sim.sensor.sensor import Sensor

KINDS = (Component.DIRECT, Component.GHOST, Component.SIDELOBE)


@dataclass(frozen=True)
class DominantEchoes:
    """The echoes that dominate C cells.

    Attributes:
        power: Power of all echoes under the point spread (C,) float32 [W].
        kind: The component with most of it (C,) uint8: direct, ghost or sidelobe.
        source: Return path of the strongest echo of this kind (C,) uint32.
    """

    power: NDArray[np.float32]
    kind: NDArray[np.uint8]
    source: NDArray[np.uint32]

    def at(self, cells: NDArray[np.int64]) -> "DominantEchoes":
        """Return some of the cells.

        Args:
            cells: Indices of the cells (K,).

        Returns:
            Their dominant echoes (K).
        """
        return DominantEchoes(self.power[cells], self.kind[cells], self.source[cells])


class DominantEchoIndex:
    """The dominant echoes of the cells of one scan; a cell is an azimuth and a step of PART_STEP bins."""

    def __init__(self, echoes: Echoes, sensor: Sensor, *, steps: int) -> None:
        """Take the echoes.

        Args:
            echoes: The echoes that reach the receiver.
            sensor: The radar.
            steps: Number of steps per azimuth.
        """
        self.echoes = echoes
        self._steps = steps
        self._cells = sensor.azimuths * steps
        self._sensor = sensor
        self._memo: dict[bytes, tuple[NDArray[np.bool_], DominantEchoes]] = {}

    @cached_property
    def _summed(self) -> "tuple[mi.Float, mi.UInt64]":
        """The power of the echoes by cell and kind, and the strongest of them with its return path.

        The largest (power, return) pair is an integer maximum, which does not depend on the order of work.
        """
        echoes, sensor, kinds = self.echoes, self._sensor, len(KINDS)
        step = ((grid_place(echoes.range_m, sensor) + 0.5) * (1 / PART_STEP)).astype(np.int32)
        np.clip(step, 0, self._steps - 1, out=step)
        ghost = (echoes.returns.bounces > 1).astype(np.int32)[echoes.source]
        kind = np.where(echoes.sidelobe, np.int32(2), ghost)
        number = (echoes.azimuth * np.int32(self._steps) + step) * np.int32(kinds) + kind
        power = np.square(echoes.amplitude.real) + np.square(echoes.amplitude.imag)
        size = self._cells * kinds
        total = mi.Float(np.bincount(number, power, size).astype(np.float32))
        key = mi.UInt64(dr.reinterpret_array(mi.UInt32, mi.Float(power))) << 32
        best = dr.zeros(mi.UInt64, size)
        index = mi.UInt32(number.astype(np.uint32))
        dr.scatter_reduce(dr.ReduceOp.Max, best, key | mi.UInt64(mi.UInt32(echoes.source)), index)
        dr.eval(total, best)
        return total, best

    def within(self, shape: NDArray[np.float32], cells: NDArray[np.int64]) -> DominantEchoes:
        """Return the echoes that dominate cells under a point spread.

        Args:
            shape: Power of the point spread at whole steps from its peak (K + 1,), 1 at the peak.
            cells: Flat cell numbers, azimuth * steps + step (C,).

        Returns:
            The dominant echoes (C).
        """
        if len(self.echoes) == 0:
            count = len(cells)
            return DominantEchoes(
                np.zeros(count, np.float32), np.zeros(count, np.uint8), np.zeros(count, np.uint32)
            )
        key = shape.tobytes()
        if key not in self._memo:
            self._memo[key] = self._empty()
        known, found = self._memo[key]
        new = cells[~known[cells]]
        if len(new):
            found.power[new], found.kind[new], found.source[new] = self._spread(shape, new)
            known[new] = True
        return found.at(cells)

    def _empty(self) -> tuple[NDArray[np.bool_], DominantEchoes]:
        """Return a memo without an answer: which cells are known, and room for their dominant echoes."""
        size = self._cells
        nothing = DominantEchoes(
            np.empty(size, np.float32), np.empty(size, np.uint8), np.empty(size, np.uint32)
        )
        return np.zeros(size, np.bool_), nothing

    def _spread(
        self, shape: NDArray[np.float32], cells: NDArray[np.int64]
    ) -> tuple[NDArray[np.float32], NDArray[np.uint8], NDArray[np.uint32]]:
        """Return power, dominant kind and strongest return path of each cell."""
        total, best = self._summed
        kinds = len(KINDS)
        azimuths, steps = np.divmod(cells.astype(np.uint32), np.uint32(self._steps))
        azimuth, step = mi.UInt32(azimuths), mi.UInt32(steps)
        sums = [mi.Float(0) for _ in KINDS]
        for share, cell, valid in self._neighbours(azimuth, step, shape):
            for kind in range(kinds):
                sums[kind] += dr.gather(mi.Float, total, cell * kinds + kind, valid) * share
        most = dr.select(sums[1] > sums[0], mi.UInt32(1), 0)
        most = dr.select(sums[2] > dr.maximum(sums[0], sums[1]), 2, most)
        largest, source = mi.Float(-1), mi.UInt32(0)
        for share, cell, valid in self._neighbours(azimuth, step, shape):
            pair = dr.gather(mi.UInt64, best, cell * kinds + most, valid)
            power = dr.reinterpret_array(mi.Float, mi.UInt32(pair >> 32)) * share
            better = valid & (power > largest)
            largest = dr.select(better, power, largest)
            source = dr.select(better, mi.UInt32(pair & 0xFFFFFFFF), source)
        power = sums[0] + sums[1] + sums[2]
        dr.eval(power, most, source)
        return power.numpy(), np.array(KINDS, np.uint8)[most.numpy()], source.numpy()

    def _neighbours(
        self, azimuth: "mi.UInt32", step: "mi.UInt32", shape: NDArray[np.float32]
    ) -> "Iterator[tuple[float, mi.UInt32, mi.Bool]]":
        """Yield share, number and existence of each step in range within the point spread."""
        for offset in range(-len(shape) + 1, len(shape)):
            cell = mi.Int32(step) + offset
            valid = (cell >= 0) & (cell < self._steps)
            yield float(shape[abs(offset)]), mi.UInt32(mi.Int32(azimuth * self._steps) + cell), valid
