"""Ground truth of training pairs: true motions, and the distortion of scans taken by a moving car.

Source: Burnett et al., RA-L 2021, as in `learn.geometry.motion_compensation`; velocities are those between
the poses of neighbouring scans.
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

_ITERATIONS = 8
"""Fixed-point iterations of `ScanDistortion.from_mid_scan`."""


@dataclass(frozen=True, kw_only=True)
class ScanDistortion:
    """What the car's motion does to B scans, and where their images show them.

    Attributes:
        scan_in_image: Poses of the scans in the frames of their images.
        twist: Velocities of the car at mid-scan.
        scan_s: Duration of a revolution (B,) [s].
        seam_rad: Azimuth at which a revolution starts (B,) [rad].
        doppler_beta_s: Range by which an approaching object appears too near, by its speed (B,) [m per m/s].
    """

    scan_in_image: Motion
    twist: Twist
    scan_s: Tensor
    seam_rad: Tensor
    doppler_beta_s: Tensor

    def to_mid_scan(self, points_m: Tensor) -> Tensor:
        """Move points of the images to where they would be if all azimuths had been measured at mid-scan.

        Args:
            points_m: Points (B, N, 2) in the images: forward, right [m].

        Returns:
            The corrected points (B, N, 2), in the same frames [m].
        """
        in_scan = (points_m - self.scan_in_image.translation_m[:, None]) @ self.scan_in_image.rotation
        corrected = to_mid_scan(
            in_scan,
            self.twist,
            scan_s=self.scan_s,
            seam_rad=self.seam_rad,
            doppler_beta_s=self.doppler_beta_s,
        )
        return moved(corrected, self.scan_in_image)

    def from_mid_scan(self, points_m: Tensor) -> Tensor:
        """Invert `to_mid_scan` by fixed-point iteration.

        The distortion changes little over the distance by which it moves a point: after eight iterations 1 mm
        is left at 10 m from a car at 30 m/s.

        Args:
            points_m: Points (B, N, 2) at mid-scan: forward, right [m].

        Returns:
            Where the images show them (B, N, 2) [m].
        """
        distorted = points_m
        for _ in range(_ITERATIONS):
            distorted = points_m - (self.to_mid_scan(distorted) - distorted)
        return distorted


@dataclass(frozen=True, kw_only=True)
class GroundTruth:
    """True motions between the images of B pairs.

    Attributes:
        motion: T_destination_source between the images as they are shown.
        source: Distortion of the sources; None takes scans as measured at a single instant.
        destination: Distortion of the destinations, or None likewise.
    """

    motion: Motion
    source: ScanDistortion | None = None
    destination: ScanDistortion | None = None

    def true_places(self, source_m: Tensor) -> Tensor:
        """Map points of the sources' images to the destinations' images.

        Args:
            source_m: Points (B, N, 2): forward, right [m].

        Returns:
            Where the destinations' images show them (B, N, 2) [m].
        """
        if self.source is None or self.destination is None:
            return moved(source_m, self.motion)
        return self.destination.from_mid_scan(moved(self.source.to_mid_scan(source_m), self.motion))

    def to_mid_scan(self, matches: Matches) -> Matches:
        """Correct the points of matches for the distortion of both scans.

        Args:
            matches: Matches between the images.

        Returns:
            The matches with their points at mid-scan.
        """
        if self.source is None or self.destination is None:
            return matches
        return replace(
            matches,
            source_m=self.source.to_mid_scan(matches.source_m),
            destination_m=self.destination.to_mid_scan(matches.destination_m),
        )


@dataclass(frozen=True, kw_only=True)
class EgoMotion:
    """How the car moved at the N scans of a drive.

    Attributes:
        velocities: At mid-scan (N, 3): forward, right [m/s], clockwise [rad/s]; 0 where no neighbour has a
            pose.
        scan_s: Duration of a revolution [s].
        seam_rad: Azimuth at which it starts [rad].
        doppler_beta_s: Range by which an approaching object appears too near, by its speed [m per m/s].
    """

    velocities: NDArray[np.float64]
    scan_s: float
    seam_rad: float
    doppler_beta_s: float


def ego_motion(folder: ScanFolder, poses: NDArray[np.float64]) -> EgoMotion:
    """Compute the motion of the car at the scans of a folder.

    Args:
        folder: The scans.
        poses: Their world poses (N, 4): x, y, z [m], yaw [rad]; NaN where one is unknown.

    Returns:
        The motion.
    """
    times_s = (folder.timestamps_us - folder.timestamps_us[0]) / 1e6
    return EgoMotion(
        velocities=np.array([_velocity(poses, times_s, number) for number in range(len(poses))]),
        scan_s=1 / folder.sensor.rotation_hz,
        seam_rad=folder.sensor.seam_rad,
        doppler_beta_s=-float(folder.sensor.doppler_shift_s.mean()),
    )


def _velocity(poses: NDArray[np.float64], times_s: NDArray[np.float64], number: int) -> list[float]:
    """Return velocities between the nearest poses before and after, or between one of them and the scan's."""
    around = [each for each in (number - 1, number, number + 1) if 0 <= each < len(poses)]
    known = [each for each in around if np.isfinite(poses[each]).all()]
    if len(known) < 2 or times_s[known[-1]] <= times_s[known[0]]:
        return [0.0, 0.0, 0.0]
    motion = relative_from_world(poses[known[0]], poses[known[-1]])
    gap_s = times_s[known[-1]] - times_s[known[0]]
    twist = twist_between(to_motion(motion, torch.float64), float(gap_s))
    return [*twist.velocity_mps[0].tolist(), float(twist.yaw_rate_rps)]


def scan_distortions(scans: Sequence[tuple[EgoMotion, int]], scan_in_image: Motion) -> ScanDistortion:
    """Gather the distortions of scans of several drives.

    Args:
        scans: B scans, each the motion of its drive and its number in it.
        scan_in_image: Poses of the scans in the frames of their images.

    Returns:
        The distortions, as float32 tensors on the CPU.
    """
    velocities = torch.tensor(
        np.array([drive.velocities[number] for drive, number in scans]), dtype=torch.float32
    )
    return ScanDistortion(
        scan_in_image=scan_in_image,
        twist=Twist(velocity_mps=velocities[:, :2], yaw_rate_rps=velocities[:, 2]),
        scan_s=torch.tensor([drive.scan_s for drive, _ in scans]),
        seam_rad=torch.tensor([drive.seam_rad for drive, _ in scans]),
        doppler_beta_s=torch.tensor([drive.doppler_beta_s for drive, _ in scans]),
    )
