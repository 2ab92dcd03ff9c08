"""Metrics of an odometry: errors of its pairs, its drift, its speed.

The errors of a pair are |t - t_true| [m] and |yaw - yaw_true| [deg] of the motion from scan to scan; failed
pairs count as no motion. Drift is KITTI's (eval/odometry/kitti_drift.py), over every run of scans with known
truth.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from echoscape.eval.odometry.kitti_drift import (
    KITTI_STEP,
    RADAR_STEP,
    concatenated,
    mean_drift,
    segment_errors,
)
from echoscape.eval.odometry.run import OdometryResult
from echoscape.sim.datasets.se2 import wrapped

_PERCENTILES = (50, 90, 99, 100)


def pair_errors(result: OdometryResult) -> NDArray[np.float64]:
    """Compute the errors of all pairs.

    Args:
        result: The odometry.

    Returns:
        Translation [m] and rotation [rad] errors (N - 1, 2), NaN where the truth is unknown.
    """
    if result.true_motions is None:
        return np.full((len(result.pairs), 2), np.nan)
    error = result.motions - result.true_motions
    return np.stack([np.hypot(error[:, 0], error[:, 1]), np.abs(wrapped(error[:, 2]))], axis=1)


def odometry_metrics(result: OdometryResult) -> dict[str, Any]:
    """Compute the metrics of an odometry.

    Args:
        result: The odometry.

    Returns:
        Values by name, ready for JSON; None (null) where truth or segments are missing. docs/results.md lists
        them.
    """
    errors = pair_errors(result)
    known = errors[np.isfinite(errors).all(axis=1)]
    return {
        "method": result.method,
        "scans": len(result.names),
        "pairs": len(result.pairs),
        "failed_pairs": int(result.failed.sum()),
        "pairs_with_truth": len(known),
        **_summary("translation_error_m", known[:, 0]),
        **_summary("rotation_error_deg", np.degrees(known[:, 1])),
        "kitti_drift": _drift(result, KITTI_STEP),
        f"kitti_drift_step_{RADAR_STEP}": _drift(result, RADAR_STEP),
        "path_m": _path_m(result),
        "pairs_per_s": result.pairs_per_s,
        "failures": [
            {"pair": i, "earlier": result.names[i], "later": result.names[i + 1], "reason": pair.failure}
            for i, pair in enumerate(result.pairs)
            if pair.motion is None
        ],
    }


def runs_of_true(known: NDArray[np.bool_]) -> list[slice]:
    """Find the runs of True in an array.

    Args:
        known: Flags (N,).

    Returns:
        A slice for each run, in order.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8)))
    return [slice(int(first), int(end)) for first, end in edges.reshape(-1, 2)]


def _summary(name: str, errors: NDArray[np.float64]) -> dict[str, float | None]:
    """Return mean, median, percentiles and maximum of errors (K,) by name."""
    labels = [f"{name}_{each}" for each in ("mean", "median", "p90", "p99", "max")]
    if not len(errors):
        return dict.fromkeys(labels)
    values = [errors.mean(), *np.percentile(errors, _PERCENTILES)]
    return {label: float(value) for label, value in zip(labels, values, strict=True)}


def _drift(result: OdometryResult, step: int) -> dict[str, Any]:
    """Return the drift with segments that start at every `step`-th scan."""
    parts = []
    if result.truth is not None:
        parts = [
            segment_errors(result.poses[part], result.truth[part], step=step)
            for part in runs_of_true(result.known)
        ]
    return mean_drift(concatenated(parts)).as_dict()


def _path_m(result: OdometryResult) -> float | None:
    """Return the length of the true path where it is known [m]."""
    if result.true_motions is None:
        return None
    return float(np.nansum(np.hypot(result.true_motions[:, 0], result.true_motions[:, 1])))
