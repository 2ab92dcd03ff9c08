"""Motion compensation: points of a rolling scan as they would lie had the whole scan been taken at mid-scan.

Every point is measured at the time of its azimuth, and a sweep shifts its range by the radial speed. Source:
Burnett et al., "Do We Need to Compensate for Motion Distortion and Doppler Effects in Spinning Radar
Navigation?", RA-L 2021. The car moves at constant velocity within a scan, and the points stand still.
"""

import math
from typing import Any

import numpy as np

from echoscape.sim.datasets.se2 import exp


def to_mid_scan(
    points_m: Any,
    twist: Any,
    *,
    revolution_s: Any,
    seam_rad: Any,
    doppler_beta_s: Any = 0.0,
    xp: Any = np,
) -> Any:
    """Undo the motion distortion and the Doppler shift of points.

    A point that lies a revolutions clockwise of the seam was measured at t = (a - 1/2) revolution_s from
    mid-scan. Its true range is r + doppler_beta_s v_c, where v_c is the closing speed; it is mapped by the
    car's pose exp(t twist).

    Args:
        points_m: Measured points (..., N, 2): forward, right [m] of the car at the time of their azimuth.
        twist: Velocities of the car in its own frame (..., 3): forward, right [m/s], clockwise [rad/s].
        revolution_s: Duration of a revolution [s]; broadcast against (..., N).
        seam_rad: Azimuth at which it starts, `PolarScan.seam_rad` [rad]; broadcast against (..., N).
        doppler_beta_s: Range by which an approaching point appears too near, by its closing speed
            [m per m/s]; broadcast against (..., N).
        xp: Array namespace of the points: `numpy` or `torch`.

    Returns:
        The points (..., N, 2) in the frame of the car at mid-scan [m], as arrays of `xp`.
    """
    range_m = xp.linalg.vector_norm(points_m, axis=-1, keepdims=True)
    beam = points_m / xp.clip(range_m, 1e-6, None)
    closing_mps = xp.sum(beam * twist[..., None, :2], axis=-1)
    points_m = points_m + (doppler_beta_s * closing_mps)[..., None] * beam
    forward, right = points_m[..., 0], points_m[..., 1]
    after_seam_rad = xp.arctan2(right, forward) - seam_rad
    time_s = (after_seam_rad / (2 * math.pi) % 1 - 0.5) * revolution_s
    pose = exp(twist[..., None, :] * time_s[..., None], xp=xp)
    cosine, sine = xp.cos(pose[..., 2]), xp.sin(pose[..., 2])
    rotated = xp.stack([cosine * forward - sine * right, sine * forward + cosine * right], axis=-1)
    return pose[..., :2] + rotated
