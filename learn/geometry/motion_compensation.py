"""Points of a rolling scan as they would be had the whole scan been taken at its middle: motion and Doppler.

Source: Burnett et al., "Do We Need to Compensate for Motion Distortion and Doppler Effects in Spinning Radar
Navigation?", RA-L 2021. The car is taken to go on as it went between the two scans (constant velocity), and
what is matched to stand still.
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
    """The scans' times are none that points could be moved by."""


@dataclass(frozen=True, kw_only=True)
class ScanMotionModel:
    """How the scans of a pair came about.

    turn_s: time of a scan, whose first row looks ahead and whose rows go clockwise; doppler_beta_s: range by
    which what approaches appears too near, by its speed [m per m/s]; gap_s: from the middle of the
    destination to that of the source, below 0 where the source is the earlier one.
    """

    turn_s: float
    doppler_beta_s: float
    gap_s: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.turn_s) and self.turn_s > 0):
            raise ScanMotionError(f"turn_s must be finite and above 0, got {self.turn_s}")
        if not math.isfinite(self.doppler_beta_s):
            raise ScanMotionError(f"doppler_beta_s must be finite, got {self.doppler_beta_s}")
        if not (math.isfinite(self.gap_s) and self.gap_s != 0):
            raise ScanMotionError(f"gap_s must be finite and not 0, got {self.gap_s}")


@dataclass(frozen=True, kw_only=True)
class Twist:
    """Velocities of B cars in their own frames: (B, 2) forward, right [m/s], (B,) clockwise [rad/s]."""

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
    points_m: Tensor, twist: Twist, *, turn_s: float | Tensor, doppler_beta_s: float | Tensor
) -> Tensor:
    """Undo the motion distortion and the Doppler shift of points (`sim.datasets.motion_compensation`).

    Args:
        points_m: Measured points (B, N, 2): forward, right [m].
        twist: Velocities of the B cars.
        turn_s: Duration of a revolution, of all scans or (B,) [s].
        doppler_beta_s: Range by which an approaching point appears too near, by its closing speed, of all
            scans or (B,) [m per m/s].

    Returns:
        The points (B, N, 2) in the frames of mid-scan [m].
    """
    revolution_s, beta_s = (torch.as_tensor(each).reshape(-1, 1) for each in (turn_s, doppler_beta_s))
    velocities = torch.cat([twist.velocity_mps, twist.yaw_rate_rps[:, None]], -1)
    return motion_compensation.to_mid_scan(
        points_m, velocities, revolution_s=revolution_s, doppler_beta_s=beta_s, xp=torch
    )


@dataclass(frozen=True, kw_only=True)
class Part:
    """Matches of one source with one destination, and where that stood in the frame of the answer.

    twist: the destination's velocities, None for those that lead from the last part's to the source; weight:
    what its matches' own weights are multiplied by, against other parts'.
    """

    matches: Matches
    stood_at: Motion
    twist: Twist | None = None
    weight: float = 1.0


def solve_compensated(
    parts: Sequence[Part], *, scale_m: float | None = None, rolling: ScanMotionModel | None = None
) -> tuple[Motion, tuple[Part, ...]]:
    """Return the motion of one source by all of its matches, and the parts with their points at mid-scan.

    scale_m: of `robust_motion`; None for least squares of all. With `rolling`, the motion of points as they
    are gives the velocities, those from the last part's destination to the source; they move the points of
    both, and of other destinations whose own are not known, and so on, thrice: each round leaves about a
    thousandth of the error before it. Without it, points are taken as they are.
    """
    seen, motion = tuple(parts), _joint(parts, scale_m)
    if rolling is None:
        return motion, seen
    parts = [_with_known_destinations(part, rolling) for part in parts]
    for _ in range(_ROUNDS):
        seen = _rolled(parts, twist_between(relative(parts[-1].stood_at, motion), rolling.gap_s), rolling)
        motion = _joint(seen, scale_m, near=motion)
    return motion, seen


def _joint(parts: Sequence[Part], scale_m: float | None, near: Motion | None = None) -> Motion:
    together = Matches(
        source_m=torch.cat([part.matches.source_m for part in parts], 1),
        destination_m=torch.cat([moved(part.matches.destination_m, part.stood_at) for part in parts], 1),
        weights=torch.cat([part.weight * part.matches.weights for part in parts], 1),
        precision=_joint_precision(parts),
    )
    return together.motion(robust_scale_m=scale_m, near=near)


def _joint_precision(parts: Sequence[Part]) -> Tensor | None:
    """Return the matches' precisions in the frame of the answer, None unless all have it."""
    told = [(part.matches.precision, part.stood_at.rotation) for part in parts]
    known = [turned_precision(each, rotation) for each, rotation in told if each is not None]
    return torch.cat(known, 1) if len(known) == len(told) else None


def _with_known_destinations(part: Part, rolling: ScanMotionModel) -> Part:
    """Return a part with its destinations at mid-scan, if they have velocities of their own."""
    if part.twist is None:
        return part
    there_m = _at_middle(part.matches.destination_m, part.twist, rolling)
    return replace(part, matches=replace(part.matches, destination_m=there_m))


def _rolled(parts: Sequence[Part], twist: Twist, rolling: ScanMotionModel) -> tuple[Part, ...]:
    """Return parts with the source's points moved by a twist, and destinations without one of their own."""
    open_ends = [part.matches.destination_m for part in parts if part.twist is None]
    points = [part.matches.source_m for part in parts] + open_ends
    moved_m = _at_middle(torch.cat(points, 1), twist, rolling).split([each.shape[1] for each in points], 1)
    sources, ends = moved_m[: len(parts)], iter(moved_m[len(parts) :])
    return tuple(
        replace(
            part,
            matches=replace(
                part.matches,
                source_m=source_m,
                destination_m=part.matches.destination_m if part.twist is not None else next(ends),
            ),
        )
        for part, source_m in zip(parts, sources, strict=True)
    )


def _at_middle(points_m: Tensor, twist: Twist, rolling: ScanMotionModel) -> Tensor:
    return to_mid_scan(points_m, twist, turn_s=rolling.turn_s, doppler_beta_s=rolling.doppler_beta_s)
