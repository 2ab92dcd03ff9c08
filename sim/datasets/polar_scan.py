"""A scan and its ground truth as plain arrays: what data sets hold, without a ray tracer."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from echoscape.sim.datasets.array_record import ArrayRecord
from echoscape.sim.datasets.beat_signal import BeatSignal


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
        displaced: Whether the cell's strongest echo came over several surfaces and shows none of them in its
            place: not within two range resolution cells and a beam width, bool.
    """

    component: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    class_id: NDArray[np.uint8]
    bounces: NDArray[np.uint8]
    moving: NDArray[np.bool_]
    displaced: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class MoverBoxes(ArrayRecord):
    """Boxes of the M movers near the radar in the world frame, at mid-scan and when the beam meets them.

    Attributes:
        instance: Instance ids (M,) uint32.
        class_id: Classes (M,) uint8.
        centre: Centres of the boxes (M, 3) [m].
        extent: Length, width and height (M, 3) [m].
        yaw: Headings (M,) [rad], counter-clockwise.
        velocity: Velocities (M, 3) [m/s].
        row: Azimuth whose beam, at its own time, points nearest to the centre (M,) int32.
        row_centre: Centres of the boxes at the time of that azimuth (M, 3) [m].
        row_yaw: Headings at that time (M,) [rad].
    """

    instance: NDArray[np.uint32]
    class_id: NDArray[np.uint8]
    centre: NDArray[np.float64]
    extent: NDArray[np.float64]
    yaw: NDArray[np.float64]
    velocity: NDArray[np.float64]
    row: NDArray[np.int32]
    row_centre: NDArray[np.float64]
    row_yaw: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class ScanTruth(ArrayRecord):
    """Ground truth of one scan.

    Attributes:
        cells: Truth of every cell.
        pose: World pose of the car at each azimuth (azimuths, 4): x, y, z [m], yaw [rad].
        middle_pose: World pose of the car at mid-scan (4,).
        middle_us: Mid-scan, the time that odometry refers to [us].
        saturated: Whether the receiver was compressed by 1 dB or more, or clipped, at each azimuth
            (azimuths,) bool.
        first_obstacle_m: Distance to the first object in the beam that is not ground (azimuths,) float32 [m],
            inf where there is none.
        boxes: Movers near the radar.
        attitude: Pitch, nose up, and roll, right side down, of the car at each azimuth (azimuths, 2) [rad],
            as the scan was simulated.
    """

    cells: CellTruth
    pose: NDArray[np.float64]
    middle_pose: NDArray[np.float64]
    middle_us: int
    saturated: NDArray[np.bool_]
    first_obstacle_m: NDArray[np.float32]
    boxes: MoverBoxes
    attitude: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class PolarScan(ArrayRecord):
    """A scan as the sensor writes it, with its truth where that is known.

    Azimuth i looks along `azimuth_rad[i]`, clockwise from straight ahead; bin k is centred at
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

        They jump where a real scan lacks azimuths.
        """
        return self.encoder.astype(np.float64) * (2 * np.pi / self.encoder_per_turn)

    @property
    def first_azimuth_rad(self) -> float:
        """Direction of the first azimuth by its encoder count [rad]; the others follow at even steps.

        Ahead in a scan whose encoder columns are empty.
        """
        return float(self.azimuth_rad[0])

    @property
    def seam_rad(self) -> float:
        """Azimuth at which the revolution begins and ends, half a step before the first azimuth [rad]."""
        return self.first_azimuth_rad - np.pi / len(self.encoder)

    @property
    def revolution_s(self) -> float:
        """Duration of the revolution by the times of the azimuths, that of the last one included [s]."""
        azimuths = len(self.timestamp_us)
        between_s = (int(self.timestamp_us[-1]) - int(self.timestamp_us[0])) / 1e6
        return between_s * azimuths / max(azimuths - 1, 1)
