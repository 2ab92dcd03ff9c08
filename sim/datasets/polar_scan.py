"""A scan and its truth as plain arrays: what is read, written and learned from, without a ray tracer."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.beat_signal import BeatSignal

EPOCH_US = 1_700_000_000_000_000
"""Time stamp of a drive's start [us since 1970]; simulated drives all begin then."""


class Component(IntEnum):
    """What a cell's power comes from."""

    NOISE = 0
    LEAKAGE = 1
    DIRECT = 2
    GHOST = 3
    SIDELOBE = 4
    SPOKE = 5
    RAIN = 6
    INTERFERENCE = 7


@dataclass(frozen=True, kw_only=True)
class CellTruth:
    """Truth by cell, all arrays (azimuths, bins).

    component, class_id and bounces are uint8, instance uint32, moving bool; class_id, instance, bounces and
    moving are 0 where no single thing dominates.
    """

    component: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    class_id: NDArray[np.uint8]
    bounces: NDArray[np.uint8]
    moving: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class MoverBoxes:
    """Boxes of the movers near the radar at mid-scan, M of them.

    instance (M,) uint32; class_id (M,) uint8; centre (M, 3), extent (M, 3) length, width, height [m]; yaw
    (M,) [rad]; velocity (M, 3) [m/s]; float64, world frame.
    """

    instance: NDArray[np.uint32]
    class_id: NDArray[np.uint8]
    centre: NDArray[np.float64]
    extent: NDArray[np.float64]
    yaw: NDArray[np.float64]
    velocity: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ScanTruth:
    """The truth of one scan.

    cells: by cell; pose (azimuths, 4) float64: x, y, z [m], yaw [rad] of the car in the world at each row;
    middle_pose (4,): the same at `middle_us`, the time that odometry refers to; saturated (azimuths,) bool;
    first_m (azimuths,) float32: distance of the first thing in the beam that is no ground [m], inf if none;
    boxes: the movers near the radar at mid-scan.
    """

    cells: CellTruth
    pose: NDArray[np.float64]
    middle_pose: NDArray[np.float64]
    middle_us: int
    saturated: NDArray[np.bool_]
    first_m: NDArray[np.float32]
    boxes: MoverBoxes


@dataclass(frozen=True, kw_only=True)
class PolarScan:
    """A scan as the sensor writes it, with its truth where it is known.

    codes (azimuths, bins) uint8: half decibels; timestamp_us (azimuths,) int64; encoder (azimuths,) uint16,
    `encoder_per_turn` counts a turn; valid (azimuths,) bool; bin_m: range step [m]; rising (azimuths,) bool:
    whether each row's sweep rises, None unless they alternate. Row i looks along azimuth 2 pi i / azimuths,
    clockwise from straight ahead; bin k is centred at (k + 1/2) bin_m. beat: the raw data that the codes were
    made from, where they were kept.
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
        """Azimuth of each row (azimuths,) as its encoder tells it, which is what public loaders use [rad].

        It differs from 2 pi i / azimuths by a constant, the encoder's first count: 13 is the end of the 14
        counts that a row takes, 7 their middle. Where a real scan lacks rows it jumps.
        """
        return self.encoder.astype(np.float64) * (2 * np.pi / self.encoder_per_turn)
