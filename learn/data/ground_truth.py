"""What is known of training pairs: true motions, and how the scans rolled while their cars moved.

Source: Burnett et al., RA-L 2021, as in `rolling`; velocities come of the poses of neighbouring scans.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.motion_compensation import Twist, to_mid_scan, twist_between
from echoscape.learn.geometry.procrustes import Motion, moved
from echoscape.learn.geometry.se2 import to_motion
from echoscape.sim.datasets.scan_folder import ScanFolder
from echoscape.sim.datasets.se2 import relative_from_world


@dataclass(frozen=True, kw_only=True)
class Roll:
    """How B scans rolled, and where pictures show them.

    shown_at: poses of the scans in the frames of their pictures; twist: their velocities; turn_s (B,): how
    long a turn took [s]; doppler_beta_s (B,): range by which what approaches appears too near, by its speed
    [m per m/s].
    """

    shown_at: Motion
    twist: Twist
    turn_s: Tensor
    doppler_beta_s: Tensor

    def undone(self, points_m: Tensor) -> Tensor:
        """Return what pictures show at (B, N, 2) forward, right [m] as had all been seen at mid-scan."""
        own = (points_m - self.shown_at.translation_m[:, None]) @ self.shown_at.rotation
        seen = to_mid_scan(own, self.twist, turn_s=self.turn_s, doppler_beta_s=self.doppler_beta_s)
        return moved(seen, self.shown_at)

    def done(self, points_m: Tensor) -> Tensor:
        """Return where pictures show what is at (B, N, 2) [m] at mid-scan: near enough, the inverse.

        What rolling does changes little over as far as it moves a point: eight rounds leave a millimetre of
        what is 10 m away from a car at 30 m/s.
        """
        shown = points_m
        for _ in range(8):
            shown = points_m - (self.undone(shown) - shown)
        return shown


@dataclass(frozen=True, kw_only=True)
class Truth:
    """True motions T_destination_source between pictures as they are shown, and how their scans rolled.

    Without `source` and `destination`, points count as if each scan had been seen at once.
    """

    motion: Motion
    source: Roll | None = None
    destination: Roll | None = None

    def places(self, source_m: Tensor) -> Tensor:
        """Return where destinations show what sources show at (B, N, 2) [m]."""
        if self.source is None or self.destination is None:
            return moved(source_m, self.motion)
        return self.destination.done(moved(self.source.undone(source_m), self.motion))

    def to_mid_scan(self, matches: Matches) -> Matches:
        """Return matches as had all been seen at mid-scan."""
        if self.source is None or self.destination is None:
            return matches
        return replace(
            matches,
            source_m=self.source.undone(matches.source_m),
            destination_m=self.destination.undone(matches.destination_m),
        )


@dataclass(frozen=True, kw_only=True)
class DriveMotion:
    """How the car moved at the scans of a drive.

    velocities (N, 3): forward, right [m/s], clockwise [rad/s] at mid-scan, 0 where no neighbour tells them;
    turn_s, doppler_beta_s: see `Roll`.
    """

    velocities: NDArray[np.float64]
    turn_s: float
    doppler_beta_s: float


def drive_motion(folder: ScanFolder, poses: NDArray[np.float64]) -> DriveMotion:
    """Return how the car moved at the scans of a folder with poses (N, 4) x, y, z [m], yaw [rad]."""
    times_s = (folder.timestamps_us - folder.timestamps_us[0]) / 1e6
    return DriveMotion(
        velocities=np.array([_velocity(poses, times_s, number) for number in range(len(poses))]),
        turn_s=1 / folder.sensor.rotation_hz,
        doppler_beta_s=-float(folder.sensor.doppler_shift_s.mean()),
    )


def _velocity(poses: NDArray[np.float64], times_s: NDArray[np.float64], number: int) -> list[float]:
    """Return velocities by the nearest poses before and after, or by one of them and the scan's own."""
    around = [each for each in (number - 1, number, number + 1) if 0 <= each < len(poses)]
    known = [each for each in around if np.isfinite(poses[each]).all()]
    if len(known) < 2 or times_s[known[-1]] <= times_s[known[0]]:
        return [0.0, 0.0, 0.0]
    motion = relative_from_world(poses[known[0]], poses[known[-1]])
    gap_s = times_s[known[-1]] - times_s[known[0]]
    twist = twist_between(to_motion(motion, torch.float64), float(gap_s))
    return [*twist.velocity_mps[0].tolist(), float(twist.yaw_rate_rps)]


def rolls(scans: Sequence[tuple[DriveMotion, int]], shown_at: Motion) -> Roll:
    """Return how scans, each of a drive and by number, rolled, shown at poses."""
    velocities = torch.tensor(
        np.array([drive.velocities[number] for drive, number in scans]), dtype=torch.float32
    )
    return Roll(
        shown_at=shown_at,
        twist=Twist(velocity_mps=velocities[:, :2], yaw_rate_rps=velocities[:, 2]),
        turn_s=torch.tensor([drive.turn_s for drive, _ in scans]),
        doppler_beta_s=torch.tensor([drive.doppler_beta_s for drive, _ in scans]),
    )
