"""Motion compensation of matches: poses from mid-scan to mid-scan, at the velocity of the estimate itself.

Source: Burnett et al., "Do We Need to Compensate for Motion Distortion and Doppler Effects in Spinning Radar
Navigation?", RA-L 2021. The car moves at the constant velocity between the two scans, and matched points
stand still.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from echoscape.learn.geometry.matches import Matches
from echoscape.learn.geometry.pose_refinement import turned_precision
from echoscape.learn.geometry.procrustes import Motion, moved
from echoscape.learn.geometry.se2 import relative
from echoscape.sim.datasets import motion_compensation, se2

_ROUNDS = 3


class ScanMotionError(ValueError):
    """The times of scans give no velocity or no duration."""


@dataclass(frozen=True, kw_only=True)
class ScanMotionModel:
    """Timing of a pair of rolling scans.

    Attributes:
        scan_s: Duration of a scan, which goes clockwise [s].
        seam_rad: Azimuth at which it starts [rad].
        doppler_beta_s: Range by which an approaching point appears too near, by its closing speed
            [m per m/s].
        gap_s: From mid-scan of the destination to that of the source, below 0 if the source is earlier [s].
    """

    scan_s: float
    seam_rad: float
    doppler_beta_s: float
    gap_s: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.scan_s) and self.scan_s > 0):
            raise ScanMotionError(f"scan_s must be finite and above 0, got {self.scan_s}")
        if not math.isfinite(self.seam_rad):
            raise ScanMotionError(f"seam_rad must be finite, got {self.seam_rad}")
        if not math.isfinite(self.doppler_beta_s):
            raise ScanMotionError(f"doppler_beta_s must be finite, got {self.doppler_beta_s}")
        if not (math.isfinite(self.gap_s) and self.gap_s != 0):
            raise ScanMotionError(f"gap_s must be finite and not 0, got {self.gap_s}")


@dataclass(frozen=True, kw_only=True)
class Twist:
    """Velocities of B cars in their own frames.

    Attributes:
        velocity_mps: Forward, right (B, 2) [m/s].
        yaw_rate_rps: Clockwise (B,) [rad/s].
    """

    velocity_mps: Tensor
    yaw_rate_rps: Tensor


def twist_between(motion: Motion, gap_s: float) -> Twist:
    """Compute the constant velocities that lead to motions: their logarithms over the time.

    Args:
        motion: B motions.
        gap_s: Time that they take [s].

    Returns:
        The velocities of the B cars.
    """
    poses = torch.cat([motion.translation_m, motion.yaw_rad[:, None]], -1)
    twist = se2.log(poses, xp=torch) / gap_s
    return Twist(velocity_mps=twist[:, :2], yaw_rate_rps=twist[:, 2])


def to_mid_scan(
    points_m: Tensor,
    twist: Twist,
    *,
    scan_s: float | Tensor,
    seam_rad: float | Tensor,
    doppler_beta_s: float | Tensor,
) -> Tensor:
    """Undo the motion distortion and the Doppler shift of points (`sim.datasets.motion_compensation`).

    Args:
        points_m: Measured points (B, N, 2): forward, right [m].
        twist: Velocities of the B cars.
        scan_s: Duration of a revolution, of all scans or (B,) [s].
        seam_rad: Azimuth at which it starts, of all scans or (B,) [rad].
        doppler_beta_s: Range by which an approaching point appears too near, by its closing speed, of all
            scans or (B,) [m per m/s].

    Returns:
        The points (B, N, 2) in the frames of mid-scan [m].
    """
    revolution_s, seam, beta_s = (
        torch.as_tensor(each).reshape(-1, 1) for each in (scan_s, seam_rad, doppler_beta_s)
    )
    velocities = torch.cat([twist.velocity_mps, twist.yaw_rate_rps[:, None]], -1)
    return motion_compensation.to_mid_scan(
        points_m, velocities, revolution_s=revolution_s, seam_rad=seam, doppler_beta_s=beta_s, xp=torch
    )


@dataclass(frozen=True, kw_only=True)
class Part:
    """Matches of a source with one destination, as a part of a joint estimate.

    Attributes:
        matches: The matches.
        pose: Pose of the destination in the frame of the estimate.
        twist: Velocities of the destination; None for those of the motion from the last part's destination to
            the source.
        weight: Factor of the weights of its matches, against other parts.
    """

    matches: Matches
    pose: Motion
    twist: Twist | None = None
    weight: float = 1.0


def solve_compensated(
    parts: Sequence[Part], *, scale_m: float | None = None, scan_motion: ScanMotionModel | None = None
) -> tuple[Motion, tuple[Part, ...]]:
    """Solve for the pose of a source from all of its matches, with its points moved to mid-scan.

    The motion of points as measured gives the velocities from the last part's destination to the source;
    these move the points of the source, and of destinations without velocities of their own; that is
    repeated three times, and each iteration leaves about a thousandth of the error.

    Args:
        parts: Matches with one or several destinations.
        scale_m: Scale of `robust_motion` [m]; None for least squares of all matches.
        scan_motion: Timing of the scans; None takes points as measured.

    Returns:
        The pose of the source in the frame of the parts' poses, and the parts with their points at mid-scan.
    """
    compensated, motion = tuple(parts), _joint(parts, scale_m)
    if scan_motion is None:
        return motion, compensated
    parts = [_with_destinations_at_mid_scan(part, scan_motion) for part in parts]
    for _ in range(_ROUNDS):
        twist = twist_between(relative(parts[-1].pose, motion), scan_motion.gap_s)
        compensated = _compensated(parts, twist, scan_motion)
        motion = _joint(compensated, scale_m, near=motion)
    return motion, compensated


def _joint(parts: Sequence[Part], scale_m: float | None, near: Motion | None = None) -> Motion:
    """Return the pose that fits the matches of all parts."""
    together = Matches(
        source_m=torch.cat([part.matches.source_m for part in parts], 1),
        destination_m=torch.cat([moved(part.matches.destination_m, part.pose) for part in parts], 1),
        weights=torch.cat([part.weight * part.matches.weights for part in parts], 1),
        precision=_joint_precision(parts),
    )
    return together.motion(robust_scale_m=scale_m, near=near)


def _joint_precision(parts: Sequence[Part]) -> Tensor | None:
    """Return the matches' precisions in the frame of the estimate, None unless all parts have them."""
    precisions = [(part.matches.precision, part.pose.rotation) for part in parts]
    known = [turned_precision(each, rotation) for each, rotation in precisions if each is not None]
    return torch.cat(known, 1) if len(known) == len(precisions) else None


def _with_destinations_at_mid_scan(part: Part, scan_motion: ScanMotionModel) -> Part:
    """Return a part with its destinations at mid-scan, if they have velocities of their own."""
    if part.twist is None:
        return part
    destination_m = _at_mid_scan(part.matches.destination_m, part.twist, scan_motion)
    return replace(part, matches=replace(part.matches, destination_m=destination_m))


def _compensated(parts: Sequence[Part], twist: Twist, scan_motion: ScanMotionModel) -> tuple[Part, ...]:
    """Return parts with the source's points moved by a twist, and destinations without one of their own."""
    without_twist = [part.matches.destination_m for part in parts if part.twist is None]
    points = [part.matches.source_m for part in parts] + without_twist
    compensated_m = _at_mid_scan(torch.cat(points, 1), twist, scan_motion)
    pieces = compensated_m.split([each.shape[1] for each in points], 1)
    sources, destinations = pieces[: len(parts)], iter(pieces[len(parts) :])
    return tuple(
        replace(
            part,
            matches=replace(
                part.matches,
                source_m=source_m,
                destination_m=next(destinations) if part.twist is None else part.matches.destination_m,
            ),
        )
        for part, source_m in zip(parts, sources, strict=True)
    )


def _at_mid_scan(points_m: Tensor, twist: Twist, scan_motion: ScanMotionModel) -> Tensor:
    return to_mid_scan(
        points_m,
        twist,
        scan_s=scan_motion.scan_s,
        seam_rad=scan_motion.seam_rad,
        doppler_beta_s=scan_motion.doppler_beta_s,
    )
