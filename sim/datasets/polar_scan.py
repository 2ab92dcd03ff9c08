"""A scan and its ground truth as plain arrays: what data sets hold, without a ray tracer."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.array_record import ArrayRecord
from echoscape.sim.datasets.beat_signal import BeatSignal

EPOCH_US = 1_700_000_000_000_000
"""Time stamp of the start of every simulated drive [us since 1970]."""


class Component(IntEnum):
    """Source of most of a cell's power."""

    NOISE = 0
    LEAKAGE = 1
    DIRECT = 2
    GHOST = 3
    SIDELOBE = 4
    SPOKE = 5
    RAIN = 6
    INTERFERENCE = 7


@dataclass(frozen=True, kw_only=True, eq=False)
class CellTruth(ArrayRecord):
    """Ground truth of every cell of a polar scan; all arrays are (azimuths, bins).

    Attributes:
        component: Source of most of the cell's power, a `Component`, uint8.
        instance: Instance id of the object, 0 where no single one dominates, uint32.
        class_id: Its class, 0 where no single object dominates, uint8.
        bounces: Surfaces that its path met, 0 where no single object dominates, uint8.
        moving: Whether the object is a mover, bool.
    """

    component: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    class_id: NDArray[np.uint8]
    bounces: NDArray[np.uint8]
    moving: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class MoverBoxes(ArrayRecord):
    """Boxes of the M movers near the radar at mid-scan, in the world frame.

    Attributes:
        instance: Instance ids (M,) uint32.
        class_id: Classes (M,) uint8.
        centre: Centres of the boxes (M, 3) [m].
        extent: Length, width and height (M, 3) [m].
        yaw: Headings (M,) [rad], counter-clockwise.
        velocity: Velocities (M, 3) [m/s].
    """

    instance: NDArray[np.uint32]
    class_id: NDArray[np.uint8]
    centre: NDArray[np.float64]
    extent: NDArray[np.float64]
    yaw: NDArray[np.float64]
    velocity: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanTruth(ArrayRecord):
    """Ground truth of one scan.

    Attributes:
        cells: Truth of every cell.
        pose: World pose of the car at each azimuth (azimuths, 4): x, y, z [m], yaw [rad].
        middle_pose: World pose of the car at mid-scan (4,).
        middle_us: Mid-scan, the time that odometry refers to [us].
        saturated: Whether the converter clipped at each azimuth (azimuths,) bool.
        first_obstacle_m: Distance to the first object in the beam that is not ground (azimuths,) float32 [m],
            inf where there is none.
        boxes: Movers near the radar at mid-scan.
    """

    cells: CellTruth
    pose: NDArray[np.float64]
    middle_pose: NDArray[np.float64]
    middle_us: int
    saturated: NDArray[np.bool_]
    first_obstacle_m: NDArray[np.float32]
    boxes: MoverBoxes


@dataclass(frozen=True, kw_only=True, eq=False)
class PolarScan(ArrayRecord):
    """A scan as the sensor writes it, with its truth where that is known.

    Azimuth i looks along 2 pi i / azimuths, clockwise from straight ahead; bin k is centred at
    (k + 1/2) bin_m.

    Attributes:
        codes: Power codes (azimuths, bins) uint8, in half decibels.
        timestamp_us: Times of the azimuths (azimuths,) int64 [us].
        encoder: Encoder counts (azimuths,) uint16.
        valid: Whether each azimuth is valid (azimuths,) bool.
        bin_m: Range step of a bin [m].
        truth: Ground truth, None where it is unknown.
        rising: Whether the sweep of each azimuth rises (azimuths,) bool, None unless sweeps alternate.
        encoder_per_turn: Encoder counts of a revolution.
        beat: Beat signal that the codes were made from, None where it was not kept.
    """

    codes: NDArray[np.uint8]
    timestamp_us: NDArray[np.int64]
    encoder: NDArray[np.uint16]
    valid: NDArray[np.bool_]
    bin_m: float
    truth: ScanTruth | None = None
    rising: NDArray[np.bool_] | None = None
    encoder_per_turn: int = 5600
    beat: BeatSignal | None = None

    @property
    def azimuth_rad(self) -> NDArray[np.float64]:
        """Azimuths by the encoder, as public loaders take them (azimuths,) [rad].

        They differ from 2 pi i / azimuths by a constant, the encoder's first count: 13 is the end of the 14
        counts that an azimuth takes, 7 their middle. They jump where a real scan lacks azimuths.
        """
        return self.encoder.astype(np.float64) * (2 * np.pi / self.encoder_per_turn)
