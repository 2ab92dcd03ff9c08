"""Figures of an odometry: errors of its pairs, its drift, its speed.

A pair's errors are |t - t_true| [m] and |yaw - yaw_true| [deg] of the motion from scan to scan; failed pairs
count as no motion. Drift is KITTI's (eval/odometry/kitti_drift.py), over every stretch of scans whose truth is known.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.odometry.kitti_drift import KITTI_STEP, RADAR_STEP, drift_of_segments, joined, segments
from echoscape.eval.odometry.run import OdometryResult

_SHARES = (50, 90, 99, 100)


def pair_errors(odometry: OdometryResult) -> NDArray[np.float64]:
    """Return errors (N - 1, 2): translation [m], rotation [rad]; NaN where truth is unknown."""
    if odometry.true_motions is None:
        return np.full((len(odometry.pairs), 2), np.nan)
    off = odometry.motions - odometry.true_motions
    turn = np.arctan2(np.sin(off[:, 2]), np.cos(off[:, 2]))
    return np.stack([np.hypot(off[:, 0], off[:, 1]), np.abs(turn)], axis=1)


def metrics(odometry: OdometryResult) -> dict[str, Any]:
    """Return all figures by name, ready for JSON; None (null) where truth or segments are lacking."""
    errors = pair_errors(odometry)
    judged = errors[np.isfinite(errors).all(axis=1)]
    return {
        "method": odometry.method,
        "scans": len(odometry.names),
        "pairs": len(odometry.pairs),
        "failed": int(odometry.failed.sum()),
        "judged": len(judged),
        **_figures("pair_translation_m", judged[:, 0]),
        **_figures("pair_rotation_deg", np.degrees(judged[:, 1])),
        **_drift(odometry, KITTI_STEP),
        f"step_{RADAR_STEP}": _drift(odometry, RADAR_STEP),
        "way_m": _way_m(odometry),
        "hz": odometry.hz,
        "failures": [
            {"pair": i, "earlier": odometry.names[i], "later": odometry.names[i + 1], "reason": pair.failure}
            for i, pair in enumerate(odometry.pairs)
            if pair.motion is None
        ],
    }


def stretches(known: NDArray[np.bool_]) -> list[slice]:
    """Return the runs of True in `known` (N,) as slices, in order."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8)))
    return [slice(int(first), int(end)) for first, end in edges.reshape(-1, 2)]


def _figures(name: str, errors: NDArray[np.float64]) -> dict[str, float | None]:
    """Return mean, median, percentiles and maximum of errors (K,) by name."""
    labels = [name, f"{name}_median", f"{name}_p90", f"{name}_p99", f"{name}_max"]
    if not len(errors):
        return dict.fromkeys(labels)
    values = [errors.mean(), *np.percentile(errors, _SHARES)]
    return {label: float(value) for label, value in zip(labels, values, strict=True)}


def _drift(odometry: OdometryResult, step: int) -> dict[str, Any]:
    """Return the drift with segments that start at every `step`-th frame."""
    parts = []
    if odometry.truth is not None:
        parts = [
            segments(odometry.poses[part], odometry.truth[part], step=step)
            for part in stretches(odometry.known)
        ]
    return drift_of_segments(joined(parts)).content()


def _way_m(odometry: OdometryResult) -> float | None:
    """Return how far the car truly drove where that is known [m]."""
    if odometry.true_motions is None:
        return None
    return float(np.nansum(np.hypot(odometry.true_motions[:, 0], odometry.true_motions[:, 1])))
