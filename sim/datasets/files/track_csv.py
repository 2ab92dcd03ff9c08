"""Moving objects as two tables: movers.csv (what they are) and tracks.csv (their poses over time).

World frame, z up, yaw counter-clockwise from world x, pitch positive with the nose up, roll positive with the
right side down; times on the clock of the scans' time stamps. The car
that carries the radar is instance 0 in tracks.csv.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from echoscape.scenes.core.scene import Mover
from echoscape.scenes.core.trajectory import Trajectory
from echoscape.sim.datasets.files.atomic_write import DatasetError, read_text

MOVER_COLUMNS = "instance,class,prototype,length_m,width_m,height_m"
_LEVEL_COLUMNS = "timestamp_us,instance,x_m,y_m,z_m,yaw_rad,vx_mps,vy_mps,yaw_rate_rps"
"""Those of older files."""
TRACK_COLUMNS = _LEVEL_COLUMNS + ",pitch_rad,roll_rad"


def movers_csv(movers: Sequence[Mover]) -> str:
    """Format movers.csv.

    Args:
        movers: The movers.

    Returns:
        Text with a row for each mover.
    """
    rows = [
        f"{mover.instance},{mover.prototype.class_name},{mover.prototype.name},"
        + ",".join(f"{value:.3f}" for value in mover.prototype.extent_m)
        for mover in movers
    ]
    return "\n".join([MOVER_COLUMNS, *rows]) + "\n"


def tracks_csv(
    car: Trajectory,
    movers: Sequence[Mover],
    times_s: NDArray[np.float64],
    *,
    epoch_us: int,
    attitude: float = 1.0,
) -> str:
    """Format tracks.csv.

    Args:
        car: Trajectory of the car that carries the radar.
        movers: The movers.
        times_s: Times of the rows (T,) [s].
        epoch_us: Time stamp of 0 s, `Sensor.epoch_us` [us].
        attitude: Factor on the pitch and roll of the car, as in `sim.settings.artefacts.Artefacts`.

    Returns:
        Text with the poses and velocities of car and movers, in order of time. A pose is that of the middle
        of the object's box on the ground, to a millimetre and a tenth of a milliradian.
    """
    tracks = {0: car} | {mover.instance: mover.track for mover in movers}
    states = [
        np.hstack(
            [track.pose(times_s), track.velocity(times_s)[:, [0, 1, 3]], attitude * track.tilt(times_s)]
        )
        for track in tracks.values()
    ]
    lines = [TRACK_COLUMNS]
    for i, time_s in enumerate(times_s):
        stamp = epoch_us + round(float(time_s) * 1e6)
        for instance, state in zip(tracks, states, strict=True):
            x, y, z, yaw, *others = state[i] + 0.0
            rest = ",".join(f"{value:.4f}" for value in others)
            lines.append(f"{stamp},{instance},{x:.3f},{y:.3f},{z:.3f},{yaw:.4f},{rest}")
    return "\n".join(lines) + "\n"


def ends_as_table(path: Path) -> bool:
    """Check that a table is complete, as far as its last line.

    Args:
        path: A file that may not exist.

    Returns:
        Whether the file exists and ends with a line break; one that was cut between lines does as well.
    """
    try:
        return path.read_bytes().endswith(b"\n")
    except FileNotFoundError:
        return False


@dataclass(frozen=True, kw_only=True)
class CarTrack:
    """Velocity of the car from tracks.csv.

    Attributes:
        time_us: Times (T,) int64 [us].
        rate: vx, vy in the world [m/s] and yaw rate, counter-clockwise [rad/s] (T, 3).
    """

    time_us: NDArray[np.int64]
    rate: NDArray[np.float64]

    def velocity(self, stamps_us: NDArray[np.int64]) -> NDArray[np.float64]:
        """Interpolate the velocity linearly.

        Args:
            stamps_us: Times (N,) [us].

        Returns:
            vx, vy [m/s] and yaw rate [rad/s] (N, 3).
        """
        known = (self.time_us - self.time_us[0]).astype(np.float64)
        wanted = (stamps_us - self.time_us[0]).astype(np.float64)
        return np.stack([np.interp(wanted, known, column) for column in self.rate.T], axis=1)


def read_car_track(path: Path) -> CarTrack:
    """Read the car's rows (instance 0) of a tracks.csv.

    Args:
        path: The file.

    Returns:
        Velocity of the car.

    Raises:
        DatasetError: The file is absent, has another header, or has no valid row of the car.
    """
    lines = read_text(path).splitlines()
    if not lines or lines[0] not in (TRACK_COLUMNS, _LEVEL_COLUMNS):
        raise DatasetError(f"{path}: the header is not {TRACK_COLUMNS}")
    rows = [words for words in (line.split(",") for line in lines[1:]) if words[1:2] == ["0"]]
    if not rows:
        raise DatasetError(f"{path}: no row of the car, instance 0")
    try:
        times = np.array([int(words[0]) for words in rows], np.int64)
        rates = np.array([[float(word) for word in words[6:9]] for words in rows]).reshape(-1, 3)
    except ValueError as error:
        raise DatasetError(f"{path}: a row of the car is not a row of a track ({error})") from error
    return CarTrack(time_us=times, rate=rates)
