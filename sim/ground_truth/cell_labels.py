"""Labels every cell of a polar scan with what made it, known because the scan was simulated.

The receiver gives the power that echoes, noise and distortion have alone in a cell; the largest labels it.
Where that is echoes, those whose point spread covers the cell decide whether it is direct, a ghost or a
sidelobe of the beam, and the strongest of that kind names the object. Power that they do not explain is a
sidelobe of the range window.
"""

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core import portable_math
from echoscape.scenes.core.scene import CLASSES
from echoscape.sim.datasets.polar_scan import CellTruth, Component, MoverBoxes
from echoscape.sim.echoes import Echoes
from echoscape.sim.ground_truth.dominant_echo import DominantEchoes, DominantEchoIndex
from echoscape.sim.kinematics.rolling_scan import AzimuthPoses, MoverStates
from echoscape.sim.numerics.angles import principal_angle
from echoscape.sim.receiver.front_end import PART_STEP, leakage_grid
from echoscape.sim.receiver.if_signal import BIN_CENTRE, beat, sample_times, spectrum, sweep_ripple
from echoscape.sim.receiver.quantiser import LEAST_POWER
from echoscape.sim.receiver.receiver import Received
from echoscape.sim.sensor.link_budget import range_gain, units_per_watt, window, written_units
from echoscape.sim.sensor.sensor import Sensor
from echoscape.sim.settings.artefacts import Artefacts

EXPLAINED = 0.1
"""Share of the echo power of a cell that the echoes within the point spread, added by power, must reach to
explain it: speckle adds them in any phase, so a cell may hold much more or less."""


def mover_boxes(states: MoverStates, poses: AzimuthPoses, sensor: Sensor) -> MoverBoxes:
    """Return the boxes of the moving objects of a scan, at its middle azimuth and when the beam meets them.

    Args:
        states: The moving objects in reach, at each azimuth.
        poses: The antenna at each azimuth.
        sensor: The radar, which gives the direction of each azimuth.

    Returns:
        Their boxes in the world frame.
    """
    middle = states.state.shape[1] // 2
    prototypes = [mover.prototype for mover in states.movers]
    extent = np.array([prototype.extent_m for prototype in prototypes], np.float64).reshape(-1, 3)
    state, rate = states.state[:, middle], states.rate[:, middle]
    row = meeting_azimuth(states.state[..., :2], poses, sensor)
    met = states.state[np.arange(len(row)), row]
    lift = extent * [0.0, 0.0, 0.5]
    return MoverBoxes(
        instance=np.array([mover.instance for mover in states.movers], np.uint32),
        class_id=np.array([CLASSES.index(prototype.class_name) for prototype in prototypes], np.uint8),
        centre=state[:, :3] + lift,
        extent=extent,
        yaw=state[:, 3].copy(),
        velocity=rate[:, :3].copy(),
        row=row.astype(np.int32),
        row_centre=met[:, :3] + lift,
        row_yaw=met[:, 3].copy(),
    )


def meeting_azimuth(position: NDArray[np.float64], poses: AzimuthPoses, sensor: Sensor) -> NDArray[np.intp]:
    """Return the azimuth that points nearest to each of M moving points at the azimuth's own time.

    Args:
        position: x, y of the points at each azimuth (M, azimuths, 2) [m].
        poses: The antenna at each azimuth.
        sensor: The radar, which gives the direction of each azimuth.

    Returns:
        Numbers of the azimuths (M,); of several as near, the first.
    """
    away = position - poses.position[:, :2]
    beam = poses.yaw - sensor.azimuth_rad
    offset = principal_angle(portable_math.arctan2(away[..., 1], away[..., 0]) - beam)
    return np.argmin(np.abs(offset), axis=1)


def _spread_shape(sensor: Sensor, floor: float) -> NDArray[np.float32]:
    """Return the power of the point spread at whole steps from its peak (K + 1,), down to `floor`."""
    offsets = np.arange(32) * PART_STEP
    tones = np.cos(2 * np.pi * offsets[:, None] * sample_times(sensor) / sensor.fft_size)
    weight = window(sensor) * sweep_ripple(sensor)
    power = (tones @ weight / weight.sum()) ** 2
    last = int(np.flatnonzero(power >= floor)[-1])
    return power[: last + 1].astype(np.float32)


class CellLabeller:
    """Labels the cells of the scans of one sensor."""

    def __init__(self, sensor: Sensor, instance_class: NDArray[np.uint8]) -> None:
        """Tabulate point spread, gain and leakage by range.

        Args:
            sensor: The radar.
            instance_class: Class id of every instance id (I,) uint8.
        """
        self._sensor = sensor
        self._classes = instance_class
        self._shape, self._skirt = (_spread_shape(sensor, floor) for floor in (0.01, 1e-4))
        self._steps = -(-sensor.bins // PART_STEP)
        ranges = (np.arange(self._steps) * PART_STEP + BIN_CENTRE) * sensor.bin_m
        self._unit_gain = (units_per_watt(sensor) * range_gain(sensor, ranges)).astype(np.float32)
        leak = np.abs(spectrum(beat(leakage_grid(sensor), sensor), sensor, step=PART_STEP)) ** 2
        self._leakage = (leak * (written_units(sensor) * range_gain(sensor, ranges))).astype(np.float32)

    def dominant_echoes(self, echoes: Echoes) -> DominantEchoIndex:
        """Index the echoes of a scan by the cells that they dominate.

        Args:
            echoes: The echoes that reach the receiver.

        Returns:
            An index that labels under any setting of the receiver can share.
        """
        return DominantEchoIndex(echoes, self._sensor, steps=self._steps)

    def label(
        self,
        dominant: DominantEchoIndex,
        received: Received,
        artefacts: Artefacts,
        *,
        rain_w: NDArray[np.float32] | None = None,
    ) -> CellTruth:
        """Label every cell of a scan; pairs of range bins share their echoes.

        Args:
            dominant: The echoes that reached the receiver, from `dominant_echoes`.
            received: The output of the receiver with its parts.
            artefacts: Of which leakage counts.
            rain_w: Mean power of rain on the grid (azimuths, fft_size / 4) [W]; None without rain.

        Returns:
            Component, object, bounce order and displacement of each cell (azimuths, bins).
        """
        component = self._largest(received)
        cells = np.flatnonzero(component == Component.DIRECT)
        echo = received.echo.ravel()[cells]
        step = cells % self._steps
        found = self._explained(dominant, cells, echo)
        power, kind = found.power, found.kind
        explained = power * self._unit_gain[step] >= EXPLAINED * echo
        kind = np.where(explained, kind, np.uint8(Component.SIDELOBE))
        if rain_w is not None:
            rain = self._rain(rain_w).ravel()[cells]
            rains = (rain > power * self._unit_gain[step]) & (rain >= EXPLAINED * echo)
            kind = np.where(rains, np.uint8(Component.RAIN), kind)
            explained &= ~rains
        if artefacts.leakage:
            leaks = self._leakage[0, step] * (2 * artefacts.leakage) >= echo
            kind = np.where(leaks, np.uint8(Component.LEAKAGE), kind)
            explained &= ~leaks
        component.ravel()[cells] = kind
        named = self._filled(dominant.echoes, component, cells[explained], found.source[explained])
        # Power below the first code of the quantiser is noise, whatever it came from.
        return _by_bin(named, written=received.power >= LEAST_POWER)

    def _rain(self, rain_w: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the mean written power of rain at every step of every azimuth (A, S)."""
        # A step is a cell of the grid.
        cells = np.sum(self._shape) * 2 - 1  # equivalent width of the point spread, by power
        return (rain_w[:, : self._steps] * (cells * self._unit_gain)).astype(np.float32)

    def _largest(self, received: Received) -> NDArray[np.uint8]:
        """Return NOISE, DIRECT (any echo), SPOKE or INTERFERENCE by the largest part of each cell."""
        echo = (received.echo > received.noise) & (received.echo >= received.distortion)
        spoke = received.distortion > received.noise
        component = np.where(spoke, np.uint8(Component.SPOKE), np.uint8(Component.NOISE))
        component = np.where(echo, np.uint8(Component.DIRECT), component)
        if received.others is not None:
            foreign = (component == Component.SPOKE) & (received.others * 2 >= received.distortion)
            component[foreign] = Component.INTERFERENCE
        return component

    def _explained(
        self, dominant: DominantEchoIndex, cells: NDArray[np.int64], echo: NDArray[np.float32]
    ) -> DominantEchoes:
        """Return the echoes that dominate flat cell numbers (C,).

        Cells whose echo power `echo` (C,) is explained by the skirt of ghosts alone belong to these ghosts.
        """
        found = dominant.within(self._shape, cells)
        gain = self._unit_gain[cells % self._steps]
        weak = np.flatnonzero(found.power * gain < EXPLAINED * echo)
        skirt = dominant.within(self._skirt, cells[weak])
        ghosts = (skirt.kind == Component.GHOST) & (skirt.power * gain[weak] >= EXPLAINED * echo[weak])
        of_ghosts, taken = weak[ghosts], np.flatnonzero(ghosts)
        for into, values in zip(vars(found).values(), vars(skirt.at(taken)).values(), strict=True):
            into[of_ghosts] = values
        return found

    def _filled(
        self,
        echoes: Echoes,
        component: NDArray[np.uint8],
        cells: NDArray[np.int64],
        source: NDArray[np.uint32],
    ) -> CellTruth:
        """Return the labels with the objects of the given cells filled in."""
        size, shape = component.size, component.shape
        instance = np.zeros(size, np.uint32)
        class_id, bounces = np.zeros(size, np.uint8), np.zeros(size, np.uint8)
        moving, displaced = np.zeros(size, np.bool_), np.zeros(size, np.bool_)
        instance[cells] = echoes.returns.instance[source]
        class_id[cells] = self._classes[echoes.returns.instance[source]]
        bounces[cells] = echoes.returns.bounces[source]
        moving[cells] = echoes.returns.moving[source]
        displaced[cells] = echoes.returns.displaced[source]
        return CellTruth(
            component=component,
            instance=instance.reshape(shape),
            class_id=class_id.reshape(shape),
            bounces=bounces.reshape(shape),
            moving=moving.reshape(shape),
            displaced=displaced.reshape(shape),
        )


def _by_bin(steps: CellTruth, *, written: NDArray[np.bool_]) -> CellTruth:
    """Return the labels of all bins from those of steps of PART_STEP bins, 0 where nothing is `written`."""

    def widened(values: NDArray) -> NDArray:
        # Two equal neighbours are one number of twice the size: faster than repeating them one by one.
        bits = 8 * values.itemsize
        pairs = values.view(f"u{values.itemsize}").astype(f"u{PART_STEP * values.itemsize}")
        pairs |= pairs << bits
        return pairs.view(values.dtype)[:, : written.shape[1]] * written

    return CellTruth(
        component=widened(steps.component),
        instance=widened(steps.instance),
        class_id=widened(steps.class_id),
        bounces=widened(steps.bounces),
        moving=widened(steps.moving),
        displaced=widened(steps.displaced),
    )
