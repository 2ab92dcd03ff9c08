"""What made each cell of a scan, known because the scan was made.

The receiver tells how much of a cell's power echoes, noise and distortion have alone; the largest names the
cell. Where that is echoes, the strongest echo within whose point spread the cell lies says which thing it was, if
those in the main beam explain the power at all; else it is a sidelobe, of the beam or of the range window.
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.world import CLASSES
from echoscape.sim.backend import dr, mi
from echoscape.sim.echoes import Echoes
from echoscape.sim.link import range_gain, units_per_watt, window, written_units
from echoscape.sim.motion import MoverStates
from echoscape.sim.receiver import Received, leakage_grid
from echoscape.sim.sensor import Sensor
from echoscape.sim.waveform import BIN_CENTRE, beat, grid_place, spectrum


class Component(IntEnum):
    """What a cell's power comes from."""

    NOISE = 0
    LEAKAGE = 1
    DIRECT = 2
    GHOST = 3
    SIDELOBE = 4
    SPOKE = 5


EXPLAINED = 0.1
"""Share of a cell's echo power that the echoes within the point spread must reach, added by power, to explain
it: speckle adds them in any phase, so a cell may hold much more or less."""


@dataclass(frozen=True, kw_only=True)
class CellTruth:
    """Truth by cell, all (azimuths, bins): component, class_id and bounces uint8, instance uint32, moving bool.

    class_id, instance, bounces and moving are 0 where no single thing dominates.
    """

    component: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    class_id: NDArray[np.uint8]
    bounces: NDArray[np.uint8]
    moving: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class MoverBoxes:
    """Boxes of the movers near the radar at mid-scan, M of them.

    instance (M,) uint32; class_id (M,) uint8; centre (M, 3), extent (M, 3) length, width, height [m]; yaw (M,)
    [rad]; velocity (M, 3) [m/s]; float64, world frame.
    """

    instance: NDArray[np.uint32]
    class_id: NDArray[np.uint8]
    centre: NDArray[np.float64]
    extent: NDArray[np.float64]
    yaw: NDArray[np.float64]
    velocity: NDArray[np.float64]


def mover_boxes(states: MoverStates) -> MoverBoxes:
    """Return the boxes of the movers of a scan, at the middle of its rows."""
    middle = states.state.shape[1] // 2
    prototypes = [mover.prototype for mover in states.movers]
    extent = np.array([prototype.extent_m for prototype in prototypes], np.float64).reshape(-1, 3)
    state, rate = states.state[:, middle], states.rate[:, middle]
    return MoverBoxes(
        instance=np.array([mover.instance for mover in states.movers], np.uint32),
        class_id=np.array([CLASSES.index(prototype.class_name) for prototype in prototypes], np.uint8),
        centre=state[:, :3] + extent * [0.0, 0.0, 0.5],
        extent=extent,
        yaw=state[:, 3].copy(),
        velocity=rate[:, :3].copy(),
    )


def _spread_shape(sensor: Sensor) -> NDArray[np.float32]:
    """Return the point-spread power at whole bins from its peak (K + 1,), down to -20 dB."""
    offsets = np.arange(32)
    times = np.arange(sensor.samples) - sensor.samples // 2
    tones = np.cos(2 * np.pi * offsets[:, None] * times / sensor.fft_size)
    power = (tones @ window(sensor) / window(sensor).sum()) ** 2
    return power[: int(np.argmax(power < 0.01))].astype(np.float32)


class Labeller:
    """Names the cells of a sensor's scans; holds what does not change from scan to scan."""

    def __init__(self, sensor: Sensor, instance_class: NDArray[np.uint8]) -> None:
        self._sensor = sensor
        self._classes = instance_class
        self._shape = _spread_shape(sensor)
        ranges = (np.arange(sensor.bins) + BIN_CENTRE) * sensor.bin_m
        self._unit_gain = (units_per_watt(sensor) * range_gain(sensor, ranges)).astype(np.float32)
        leak = np.abs(spectrum(beat(leakage_grid(sensor), sensor), sensor)) ** 2
        self._leakage = (leak * (written_units(sensor) * range_gain(sensor, ranges))).astype(np.float32)

    def label(self, echoes: Echoes, received: Received, *, leakage: bool = True) -> CellTruth:
        """Return the truth of every cell of a scan."""
        component = self._largest(received)
        cells = np.flatnonzero(component == Component.DIRECT)
        main_beam, source, side = self._dominant(echoes, cells)
        echo = received.echo.ravel()[cells]
        bins = cells % self._sensor.bins
        explained = (main_beam * self._unit_gain[bins] >= EXPLAINED * echo) & ~side
        bounces = (
            echoes.returns.bounces[source] if len(echoes.returns.bounces) else np.ones(len(cells), np.uint8)
        )
        kind = np.where(bounces > 1, Component.GHOST, Component.DIRECT).astype(np.uint8)
        kind = np.where(explained, kind, np.uint8(Component.SIDELOBE))
        if leakage:
            leaks = self._leakage[0, bins] * 2 >= echo
            kind = np.where(leaks, np.uint8(Component.LEAKAGE), kind)
            explained &= ~leaks
        component.ravel()[cells] = kind
        return self._filled(echoes, component, cells[explained], source[explained])

    def _largest(self, received: Received) -> NDArray[np.uint8]:
        """Return NOISE, DIRECT (any echo) or SPOKE by the largest of a cell's parts."""
        component = np.full(received.power.shape, Component.NOISE, np.uint8)
        echo = (received.echo > received.noise) & (received.echo >= received.distortion)
        component[echo] = Component.DIRECT
        component[(received.distortion > received.noise) & ~echo] = Component.SPOKE
        # What the quantiser cannot tell from nothing is noise, whatever it came from.
        component[received.power < 0.5] = Component.NOISE
        return component

    def _dominant(
        self, echoes: Echoes, cells: NDArray[np.int64]
    ) -> tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.bool_]]:
        """Return, for flat cell numbers (C,): the power that main-beam echoes spread there [W], the strongest
        one's return, and whether that one came through a sidelobe after all.

        The largest (power, source) pair of each cell is found with an integer maximum, which no order changes.
        """
        sensor = self._sensor
        size = sensor.azimuths * sensor.bins
        place = np.rint(grid_place(echoes.range_m, sensor)).astype(np.int32)
        inside = (place >= 0) & (place < sensor.bins)
        number = echoes.row * np.int32(sensor.bins) + np.where(inside, place, 0)
        amplitude = echoes.amplitude
        power = np.square(amplitude.real) + np.square(amplitude.imag)
        main = np.bincount(number, power * (inside & ~echoes.sidelobe), size)
        tag = echoes.source * np.uint32(2) + echoes.sidelobe
        key = (mi.UInt64(dr.reinterpret_array(mi.UInt32, mi.Float(power))) << 32) | mi.UInt64(mi.UInt32(tag))
        best = dr.zeros(mi.UInt64, size)
        dr.scatter_reduce(dr.ReduceOp.Max, best, key, mi.UInt32(number.astype(np.uint32)), mi.Bool(inside))
        strength, tags = self._spread(
            best, mi.Float(main.astype(np.float32)), mi.UInt32(cells.astype(np.uint32))
        )
        return strength, tags >> 1, (tags & 1).astype(np.bool_)

    def _spread(
        self, best: "mi.UInt64", main: "mi.Float", cells: "mi.UInt32"
    ) -> tuple[NDArray[np.float32], NDArray[np.uint32]]:
        """Return the sum of `main` over the point spread about each cell, and the tag of the largest `best`."""
        bins, column = self._sensor.bins, mi.Int32(cells % self._sensor.bins)
        total, largest, tags = mi.Float(0), mi.Float(-1), mi.UInt32(0)
        for offset in range(-len(self._shape) + 1, len(self._shape)):
            share = float(self._shape[abs(offset)])
            valid = (column + offset >= 0) & (column + offset < bins)
            place = mi.UInt32(mi.Int32(cells) + offset)
            total += dr.gather(mi.Float, main, place, valid) * share
            pair = dr.gather(mi.UInt64, best, place, valid)
            power = dr.reinterpret_array(mi.Float, mi.UInt32(pair >> 32)) * share
            better = valid & (power > largest)
            largest = dr.select(better, power, largest)
            tags = dr.select(better, mi.UInt32(pair & 0xFFFFFFFF), tags)
        dr.eval(total, tags)
        return total.numpy(), tags.numpy()

    def _filled(
        self,
        echoes: Echoes,
        component: NDArray[np.uint8],
        cells: NDArray[np.int64],
        source: NDArray[np.uint32],
    ) -> CellTruth:
        """Return the truth with the things of the named cells filled in."""
        size, shape = component.size, component.shape
        instance = np.zeros(size, np.uint32)
        class_id, bounces, moving = (
            np.zeros(size, np.uint8),
            np.zeros(size, np.uint8),
            np.zeros(size, np.bool_),
        )
        instance[cells] = echoes.returns.instance[source]
        class_id[cells] = self._classes[echoes.returns.instance[source]]
        bounces[cells] = echoes.returns.bounces[source]
        moving[cells] = echoes.returns.moving[source]
        return CellTruth(
            component=component,
            instance=instance.reshape(shape),
            class_id=class_id.reshape(shape),
            bounces=bounces.reshape(shape),
            moving=moving.reshape(shape),
        )
